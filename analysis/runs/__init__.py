"""What a run folder holds, as tables."""
