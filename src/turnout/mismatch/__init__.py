"""Diagnosis of what a simulation lacks: localize a residual, name its cause, model it and verify the model.

Each name is imported when it is first used: who only reads a finding need not load the solver.
"""

TYPE_CHECKING = False  # as in typing
if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate, Effect, EffectSite, NamingRules, RefitStarts
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.diagnose import Diagnosis, diagnose
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.map_fit import fit_jointly
    from turnout.mismatch.engine.nuisance import Nuisance
    from turnout.mismatch.engine.observation import Observation
    from turnout.mismatch.engine.verdict import Verdict

__all__ = [
    "Candidate",
    "Case",
    "Diagnosis",
    "Effect",
    "EffectSite",
    "Fit",
    "NamingRules",
    "Nuisance",
    "Observation",
    "RefitStarts",
    "Verdict",
    "diagnose",
    "fit_jointly",
]
_MODULES = {
    "Candidate": "candidate",
    "Case": "case",
    "Diagnosis": "diagnose",
    "Effect": "candidate",
    "EffectSite": "candidate",
    "Fit": "fit",
    "NamingRules": "candidate",
    "Nuisance": "case",
    "Observation": "case",
    "RefitStarts": "candidate",
    "Verdict": "verdict",
    "diagnose": "diagnose",
    "fit_jointly": "map_fit",
}


def __getattr__(name: str) -> object:
    """Import a public name when it is first used (PEP 562)."""
    from importlib import import_module

    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = _MODULES[name]
    value = getattr(import_module(f"turnout.mismatch.engine.{module}"), name)
    globals()[name] = value
    return value
