"""Branches of equilibria and periodic orbits, their bifurcations, and curves of bifurcations."""
