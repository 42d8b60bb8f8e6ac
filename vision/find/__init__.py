"""Where the rod is, to a pixel."""
