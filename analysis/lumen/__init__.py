"""A rod photographed in a printed channel: where it lies, where it touches."""
