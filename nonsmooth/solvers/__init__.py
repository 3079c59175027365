"""Newton's method and continuation of curves: mathematics that knows no nonsmooth system."""
