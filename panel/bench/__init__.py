"""The bench while no run has it: its devices, the live picture, theory over it."""
