"""Definitions of nonsmooth systems: states, fields, surfaces, events, and how they are read and checked."""
