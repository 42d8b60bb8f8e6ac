"""From mixing ratios to modulus and remanence."""
