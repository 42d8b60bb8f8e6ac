"""Photographs as arrays in linear light."""
