"""Runs: the runner, the run folder, reading, checking and resuming it."""
