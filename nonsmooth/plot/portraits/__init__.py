"""Portraits: trajectories, phase planes, switching surfaces, manifolds and dividing curves."""
