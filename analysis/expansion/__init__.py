"""The trained expansion model."""
