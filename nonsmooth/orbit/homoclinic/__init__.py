"""Homoclinic orbits to saddles and pseudo-saddles."""
