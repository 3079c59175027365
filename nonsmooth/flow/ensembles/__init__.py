"""Ensembles: many starts and parameters, in chunks, on several workers, in memory or in files."""
