"""From pixels to mm: projection, calibration, boards."""
