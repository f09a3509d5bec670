"""Turnout: monitor railway switches and crossings with hammer tests and train passages."""

from turnout.former_names import announce_former_names

__version__ = "0.1.0"

announce_former_names()
