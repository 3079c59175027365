"""Jeffrey & Colombo 2009: the invisible two-fold (Teixeira singularity) and its nonsmooth diabolo.

``model`` has the normal form and its crossing orbits, ``results`` the claims, ``figures`` the
pictures; ``python -m papers.jeffrey_colombo_2009`` runs everything.
"""
