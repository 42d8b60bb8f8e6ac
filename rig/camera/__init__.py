"""Cameras: newest frame, locked settings, files, streams."""
