"""Other people's shapes, tables and photographs, read through one door."""
