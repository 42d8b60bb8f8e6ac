"""The guided path from nothing to a bench that is ready for its first run."""
