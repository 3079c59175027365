"""Colombo & Jeffrey 2011: every two-fold in three dimensions, and chaos without determinism.

``model`` has the normal form of all kinds and a system whose orbits return to the singularity,
``results`` the claims, ``figures`` the pictures; ``python -m papers.colombo_jeffrey_2011`` runs
everything.
"""
