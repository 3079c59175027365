"""Invariant manifolds, dividing surfaces, canards and forward-reachable sets."""
