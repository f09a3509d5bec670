"""Diagnosis of what a simulation lacks: localize a residual, name its cause, model it and verify the model."""

from turnout.mismatch.engine.candidate import Candidate, Effect, EffectSite, NamingRules, RefitStarts
from turnout.mismatch.engine.case import Case, Nuisance, Observation
from turnout.mismatch.engine.diagnose import Diagnosis, diagnose
from turnout.mismatch.engine.map_fit import Fit, fit_jointly
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
