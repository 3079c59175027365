"""Definitions of nonsmooth systems: states, fields, surfaces, events; reading and checking them."""
