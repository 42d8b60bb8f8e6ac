"""Many photographs to tables."""
