"""Bounces: work and precision, rates in 3-D, wrong itineraries."""
