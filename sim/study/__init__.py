"""Parameter studies and their figures."""
