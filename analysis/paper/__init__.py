"""The source paper: its figures again, and what its numbers say."""
