"""The stage: what it promises, where it stands, what stops it."""
