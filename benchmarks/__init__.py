"""Benchmarks of speed and error beside other tools: ``python -m benchmarks`` or ``make bench``."""
