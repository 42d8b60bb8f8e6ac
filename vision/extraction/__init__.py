"""One photograph to one measured centreline."""
