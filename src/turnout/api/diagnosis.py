"""Diagnose what a simulation lacks."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, overload

from turnout.config import Configuration
from turnout.mismatch.engine import diagnose as engine

if TYPE_CHECKING:
    import pandas

    from turnout.config.settings.mismatch import MismatchSettings
    from turnout.mismatch.engine.case import Case


@dataclass(frozen=True, repr=False)
class TurnoutFindings:
    """Findings of one visit of a turnout, one per group of neighbouring sections.

    ``tables`` maps mismatch_findings, mismatch_parameters, mismatch_curves and quarantine to their rows, with the
    columns of docs/registry.md.
    """

    turnout: str
    tables: Mapping[str, Sequence[Mapping[str, Any]]]

    @property
    def sentences(self) -> tuple[str, ...]:
        """Each finding in words, the most severe first."""
        return tuple(f"sections {row['sections']}: {row['sentence']}" for row in self.tables["mismatch_findings"])

    def frame(self, table: str = "mismatch_findings") -> pandas.DataFrame:
        """One of the ``tables`` as a data frame, one row per finding, parameter, curve or problem.

        Parameters
        ----------
        table : str
            Name of a table.

        Returns
        -------
        pandas.DataFrame
        """
        import pandas

        return pandas.DataFrame(list(self.tables[table]))

    def __repr__(self) -> str:
        words = []
        for row in self.tables["mismatch_findings"]:
            name = f" {row['term']}" if row["term"] else ""
            words.append(f"{row['sections']} {row['verdict'].replace('_', ' ')}{name} ({row['probability']:.2f})")
        n_undiagnosed = len(self.tables["quarantine"])
        words += [f"{n_undiagnosed} without answer"] if n_undiagnosed else []
        return f"TurnoutFindings({self.turnout}: {'; '.join(words) or 'no section'})"


@overload
def diagnose(
    case: Case,
    settings: MismatchSettings | None = None,
    *,
    progress: Callable[[int, int, str], Any] | None = None,
) -> engine.Diagnosis: ...


@overload
def diagnose(
    case: str,
    settings: None = None,
    *,
    configuration: str | os.PathLike | Configuration = "config",
    raw: str | os.PathLike = "raw",
    work: str | os.PathLike = "work",
    visit: str | None = None,
    sections: Sequence[str] = (),
    track: str | None = None,
) -> TurnoutFindings: ...


def diagnose(
    case: Case | str,
    settings: MismatchSettings | None = None,
    *,
    progress: Callable[[int, int, str], Any] | None = None,
    configuration: str | os.PathLike | Configuration = "config",
    raw: str | os.PathLike = "raw",
    work: str | os.PathLike = "work",
    visit: str | None = None,
    sections: Sequence[str] = (),
    track: str | None = None,
) -> engine.Diagnosis | TurnoutFindings:
    """Locate, name and verify the effects that a simulation lacks to explain recordings.

    Parameters
    ----------
    case : Case or str
        Observations with a simulator and candidate effects: ``turnout.mismatch.turnout.TrackCase``, or an own one. Or
        the id of a turnout of the ``configuration``, whose recordings are read.
    settings : MismatchSettings, optional
        Thresholds for a case; by default the defaults of section ``mismatch``. A turnout has those of its
        configuration.
    progress : callable, optional
        For a case: called with (number done, total, candidate) after every joint fit.
    configuration : path-like or Configuration
        For a turnout: the folder of the configuration.
    raw : path-like
        For a turnout: the folder of the raw files.
    work : path-like
        For a turnout: the folder of results of earlier stages and of finished fits.
    visit : str, optional
        For a turnout: "YYYY-MM-DD", "YYYY-MM" or "all"; by default the newest visit.
    sections : sequence of str
        For a turnout: labels of the sections; by default all.
    track : str, optional
        For a turnout: name of its track file; by default its own, else that of its layout.

    Returns
    -------
    Diagnosis or TurnoutFindings
        Of a case: ``verdicts``, one per effect, with answer, names, grade, probability and parameters. Of a turnout:
        the rows of the registry.

    Raises
    ------
    TypeError
        If the case is neither a case nor an id.
    SimulationError
        If the turnout has no recordings, no track file, or no such visit or section.
    ConfigErrors
        If the configuration cannot be used.
    ValueError
        If settings are given for a turnout.

    Examples
    --------
    A spring that is stiffer at large deflections than its simulation with one stiffness, measured on four days:

    >>> import numpy as np, turnout
    >>> from turnout.mismatch import Candidate, Case, Nuisance, Observation
    >>> from turnout.physics.term import Parameter
    >>> x, rng = np.linspace(-1.0, 1.0, 200), np.random.default_rng(2)
    >>> amount = Parameter("amount", "N/m³", 0.0, (-3.0, 3.0), "cubic stiffness", "example")
    >>> class Spring(Case):
    ...     nuisances = (Nuisance("stiffness", "N/m", 1.0, 0.3),)
    ...     candidates = (Candidate.of("cubic_spring", (amount,), lambda psi: psi["amount"], ((0.1,),)),)
    ...     observations = tuple(
    ...         Observation(f"test {day}", f"day {day}", x + 0.5 * x**3 + 0.01 * rng.normal(size=200), 0.01)
    ...         for day in range(4)
    ...     )
    ...     def predict(self, values, terms, observations):
    ...         return [values["stiffness"] * x + sum(terms) * x**3 for _ in observations]
    >>> turnout.diagnose(Spring())
    Diagnosis(named: cubic spring, grade A; probability 0.97, 1 candidate)

    References
    ----------
    docs/mismatch.md; docs/effects.md lists the candidate effects.
    """
    if not isinstance(case, str):
        if not hasattr(case, "candidates"):
            raise TypeError(f"a Case or the id of a turnout is needed, got {type(case).__name__}")
        return engine.diagnose(case, settings, progress)
    if settings is not None:
        raise ValueError("a turnout is diagnosed with the settings of its configuration; give none")
    from turnout.stages.mismatch_results import diagnose_turnout

    folder = configuration.folder if isinstance(configuration, Configuration) else configuration
    tables = diagnose_turnout(case, os.fspath(folder), os.fspath(raw), os.fspath(work), visit, track, tuple(sections))
    return TurnoutFindings(case, tables)
