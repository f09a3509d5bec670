"""Evaluate hammer tests: impacts with their quality, receptance, and the bands in which it can be trusted."""

from turnout.hammer_test.frf import receptance_of
from turnout.hammer_test.gate import bands_passed, gate_rejections
from turnout.hammer_test.impacts import find_impacts

__all__ = ["bands_passed", "find_impacts", "gate_rejections", "receptance_of"]
