"""One control socket for the process that owns a bench: ask, stop, pause, watch."""
