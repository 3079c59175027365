"""Speeds and errors beside other tools: ``python -m benchmarks`` or ``make bench``."""
