"""Invariant manifolds, dividing surfaces, canards, forward-reachable sets and orbits for portraits."""
