"""Where simulation and recording differ: locate, name, model, verify. The engine knows no track."""

from turnout.mismatch.candidate import Candidate
from turnout.mismatch.case import Case, Nuisance
from turnout.mismatch.diagnose import Diagnosis, diagnose
from turnout.mismatch.fit import Fit
from turnout.mismatch.joint import fit_jointly
from turnout.mismatch.observation import Observation
from turnout.mismatch.verdict import Verdict

__all__ = ["Candidate", "Case", "Diagnosis", "Fit", "Nuisance", "Observation", "Verdict", "diagnose", "fit_jointly"]
