"""A run beside its simulation."""
