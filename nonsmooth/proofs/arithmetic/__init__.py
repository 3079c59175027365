"""Interval arithmetic: values, series, polynomials and expressions in enclosures."""
