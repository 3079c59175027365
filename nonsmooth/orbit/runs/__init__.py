"""Derivatives along runs: legs, saltation, sensitivities, Poincare maps, Lyapunov exponents."""
