"""Every numeric constant of the case of a turnout states its unit, its reason and its source."""

import ast
import re
from dataclasses import fields, is_dataclass

from turnout.mismatch.turnout import defect_priors, priors, surface_priors

MODULES = (priors, surface_priors, defect_priors)

# Constants of modules that are no numbers, or follow from those in ``priors``.
TABLES = {
    "AMPLITUDES", "CASTING_SDS", "CHAIR_PARAMETERS", "CHAIR_SCATTER", "COMMON_PARAMETERS", "EXPLANATIONS", "FACTOR",
    "FIELDS", "FINE_FACTORS", "FIRST_ORDER_TYPES", "LENGTH_FIELDS", "LINES", "LINK_VALUES", "NO_EFFECTS",
    "NO_RECORDING", "OMEGA", "PAD", "PHASE_OFFSETS", "POSITION_FIELDS", "RADIUS_CHANGES", "RAIL", "RAIL_SDS", "SCANS",
    "SHIFTED_LINES", "SLEEPER", "SUPPORT_FIELDS", "SUPPORT_PARAMETERS", "TARGETS", "TOE", "UNIT_FACTORS",
    "UNPROVEN_SWITCH", "WAVELENGTHS", "WHOLE_TRACK",
}  # fmt: skip


def test_every_constant_has_a_unit_a_reason_and_a_source(repository):
    groups = {type(x).__name__: x for module in MODULES for x in vars(module).values() if is_dataclass(type(x))}
    constants = [(group, f) for group in groups.values() for f in fields(group)]
    assert len(constants) > 200
    for group, f in constants:
        unit, reason, source = (f.metadata[k] for k in ("unit", "reason", "source"))
        assert getattr(group, f.name) == f.default and unit and len(reason.split()) >= 3, f.name
        is_page = source.endswith(".md")
        assert not is_page or (repository / "docs" / source).is_file(), source
        assert is_page or source in ("convention", "numerical") or re.search(r"(19|20)\d\d$", source), source


def test_modules_hold_no_constants_of_their_own(repository):
    folder = repository / "src" / "turnout" / "mismatch" / "turnout"
    found = {
        target.id
        for path in folder.rglob("*.py")
        if path.name not in ("priors.py", "surface_priors.py", "defect_priors.py", "planned_case.py")
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.Assign)
        for name in node.targets
        for target in ast.walk(name)
        if isinstance(target, ast.Name) and target.id.strip("_").isupper() and not target.id.startswith("_")
    }
    assert found <= TABLES, sorted(found - TABLES)
