"""Reproductions of published papers, one folder each, on the public names of the library."""
