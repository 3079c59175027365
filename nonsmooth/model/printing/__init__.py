"""Expressions printed as C: statements, programs of a system, modes blended for lanes."""
