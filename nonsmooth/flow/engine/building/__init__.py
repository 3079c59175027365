"""Compilation: C sources, compilers, and the cache of compiled libraries."""
