"""Proofs about orbits: validated steps, events, itineraries."""
