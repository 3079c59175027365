"""Analysis: periodic orbits and branches, two-folds, proofs."""
