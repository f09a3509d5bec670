"""Hammer tests: from recordings to impacts with their quality, and to receptance with what can be trusted of it."""

from turnout.receptance.frf import receptance_of
from turnout.receptance.gate import bands_passed, gate_rejections
from turnout.receptance.impacts import find_impacts

__all__ = ["bands_passed", "find_impacts", "gate_rejections", "receptance_of"]
