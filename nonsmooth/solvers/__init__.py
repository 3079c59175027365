"""Newton's method and continuation of curves, independent of nonsmooth systems."""
