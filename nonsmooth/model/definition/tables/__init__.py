"""Tables: piecewise polynomials in expressions, and the systems that follow from them."""
