"""Rods with shear, stretch and the clamp's Poisson effect."""
