"""Turnout: watch railway switches and crossings from hammer tests and train passages."""

__version__ = "0.1.0"
