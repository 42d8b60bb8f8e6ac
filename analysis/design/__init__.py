"""Designs that give a wanted shape."""
