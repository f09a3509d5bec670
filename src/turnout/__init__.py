"""Turnout: monitor railway switches and crossings with hammer tests and train passages.

The names below are for scripts and notebooks; docs/api.md describes them. Each is imported when it is first used.
"""

import sys

TYPE_CHECKING = False  # as in typing, which takes longer to import than all of this module
if TYPE_CHECKING:
    from turnout.api.diagnosis import diagnose
    from turnout.api.hammer import find_impacts, identify_modes, receptance
    from turnout.api.passages import analyse_passage
    from turnout.api.recordings import load_configuration, read
    from turnout.api.registry import open_registry
    from turnout.api.simulation import load_track, load_vehicle, simulate_hammer, simulate_passage

__version__ = "0.2.0"
__all__ = [
    "analyse_passage",
    "diagnose",
    "find_impacts",
    "identify_modes",
    "load_configuration",
    "load_track",
    "load_vehicle",
    "open_registry",
    "read",
    "receptance",
    "simulate_hammer",
    "simulate_passage",
]
_MODULE_OF = {
    "analyse_passage": "turnout.api.passages",
    "diagnose": "turnout.api.diagnosis",
    "find_impacts": "turnout.api.hammer",
    "identify_modes": "turnout.api.hammer",
    "load_configuration": "turnout.api.recordings",
    "load_track": "turnout.api.simulation",
    "load_vehicle": "turnout.api.simulation",
    "open_registry": "turnout.api.registry",
    "read": "turnout.api.recordings",
    "receptance": "turnout.api.hammer",
    "simulate_hammer": "turnout.api.simulation",
    "simulate_passage": "turnout.api.simulation",
}


def __getattr__(name: str) -> object:
    """Import a public name when it is first used (PEP 562)."""
    from importlib import import_module

    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_MODULE_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


class _FormerNames:
    """The last finder of the import system: it is asked only about modules that no other finder knows."""

    @staticmethod
    def find_spec(fullname: str, path: object = None, target: object = None) -> object:
        """Tell who imports a module by its former name the present one."""
        if not fullname.startswith("turnout"):
            return None
        from turnout.former_names import find_former_name

        return find_former_name(fullname)


sys.meta_path.append(_FormerNames)  # type: ignore[arg-type]
