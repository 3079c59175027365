"""Ensembles: many starts and parameters, run in chunks by several workers, in memory or on disk."""
