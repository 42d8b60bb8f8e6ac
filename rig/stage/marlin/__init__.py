"""Stages that speak Marlin."""
