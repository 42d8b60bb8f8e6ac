"""Runs: each in a process of its own, watched through its control socket."""
