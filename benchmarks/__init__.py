"""Measured figures beside the bars they must reach: ``make bench``, or ``python -m benchmarks identify``."""
