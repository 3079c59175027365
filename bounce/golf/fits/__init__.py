"""Parameters of laws and contact models, fitted to measured bounces."""
