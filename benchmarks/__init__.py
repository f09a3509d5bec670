"""Measured figures and the bars that they must reach: ``make bench``, or ``python -m benchmarks identify``."""
