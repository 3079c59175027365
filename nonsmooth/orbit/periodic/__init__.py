"""Periodic orbits: guesses, boundary value problem, Newton's method, multipliers, symmetry."""
