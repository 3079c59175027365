"""Proofs about special points: existence, uniqueness, class, and complete lists in a box."""
