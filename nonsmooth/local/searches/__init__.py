"""Searches for special points: folds, two-folds, equilibria, pseudo-equilibria, boundary equilibria."""
