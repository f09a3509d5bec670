"""Physical and statistical constants are in one module, and units in one table."""

import ast

from syntax_trees import tree_of

from turnout import constants
from turnout.units import PARAMETER_UNITS, UNITS

# The factor 3.6 of km/h is left out: sleepers are 0.6 m apart, and positions of 3.6 m are common.
SHARED = {value for name, value in vars(constants).items() if name.isupper() and name != "KMH"} | {9.81e3}


def repeated(tree):
    """(line, value) of every number of a module that equals a shared constant."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, float) and node.value in SHARED:
            yield node.lineno, node.value


def test_no_module_repeats_a_constant(repository):
    package = repository / "src" / "turnout"
    wrong = [
        f"{path.relative_to(package)}:{line} {value}: import it from turnout.constants"
        for path in sorted(package.rglob("*.py"))
        if path.name != "constants.py"
        for line, value in repeated(tree_of(path))
    ]
    assert not wrong, "\n".join(wrong)


def test_a_repeated_constant_is_found():
    assert list(repeated(ast.parse("weight = 9.81 * mass\nhalf = 1.96 * se"))) == [(1, 9.81), (2, 1.96)]


def test_parameter_files_and_raw_files_agree_on_every_common_unit():
    raw = {name: scale for units in UNITS.values() for name, (scale, offset) in units.items() if not offset}
    common = raw.keys() & PARAMETER_UNITS.keys()
    assert {"kN", "mm", "km/h", "%", "m/s²"} <= common
    assert {name: PARAMETER_UNITS[name][1] for name in common} == {name: raw[name] for name in common}
    assert all(PARAMETER_UNITS[unit] == (unit, 1.0) for unit, _ in PARAMETER_UNITS.values() if unit in PARAMETER_UNITS)
