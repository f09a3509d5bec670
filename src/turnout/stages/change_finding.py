"""Row of ``change_findings``: hammer tests and trains together."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from turnout.mismatch.calibrated import ModelAnswer
from turnout.stages.change_text import sentence_of
from turnout.stages.change_trains import TrainTest, supports_of
from turnout.stages.visit_time import day_of


def finding_of_change(
    answer: ModelAnswer,
    test: TrainTest | None,
    n_visits: int,
    n_recordings: int,
    threshold: float = 0.0,
    n_with_trains: int = 0,
) -> dict[str, Any]:
    """Columns of ``change_findings``: hammer tests and trains together.

    Trains that name one of the names of the hammer tests decide between them. Trains that name another effect make the
    answer "a or b". Trains that decide nothing change nothing. A suspicion of the hammer tests is a name if the
    held-out trains add the evidence that it lacks.

    Parameters
    ----------
    answer : ModelAnswer
        Of the hammer tests of all visits.
    test : TrainTest or None
        Of trains.
    n_visits, n_recordings : int
        Visits with hammer tests, and their recordings.
    threshold : float
        Evidence that a name needs. [nats]
    n_with_trains : int
        Visits whose trains are part of ``answer``.

    Returns
    -------
    dict
    """
    names = answer.names
    if test is not None and test.name is not None:
        names = (test.name,) if test.name in names else (names[0], test.name)
    elif test is not None and test.finding["term"] in names:  # the trains' best name first
        names = tuple(sorted(names, key=lambda name: name != test.finding["term"]))
    verdict = answer.verdict if not names else "named" if len(names) == 1 else "a_or_b"
    row: dict[str, Any] = {
        "visit": answer.visit, "verdict": verdict, "term": names[0] if names else None,
        "rival_term": names[1] if len(names) > 1 else None,
        "component": {"ballast": "ballast", "pad": "railpad"}.get(answer.group), "position_m": answer.position,
        "change": answer.size, "change_se": answer.sd, "change_unit": answer.unit or None, "grows": answer.grows,
        "change_so_far": answer.total, "change_so_far_se": answer.total_sd,
        "gain_nats": answer.gain, "n_visits": n_visits, "n_recordings": n_recordings,
    }  # fmt: skip
    if supports := supports_of(answer):
        row |= {"first_m": supports[0], "last_m": supports[-1]}
    if answer.ends is not None:
        row |= dict(zip(("first_low_m", "first_high_m"), answer.ends.first))
        row |= dict(zip(("last_low_m", "last_high_m"), answer.ends.last))
    nats = (answer.gain or 0.0) + (test.finding.get("gain_nats", 0.0) if test is not None else 0.0)
    if answer.gain is not None:
        row["gain_nats"] = nats
    if answer.onset is not None:
        after, by = (datetime.fromisoformat(day_of(t)) for t in answer.onset)
        row |= {"onset_after_utc": after, "onset_by_utc": by}
    if test is not None:
        fits = ("fit_before_pct", "fit_after_pct", "fit_gain_se_pct", "n_held_out")
        row |= {name: test.finding[name] for name in fits} | {"trains_visit": test.visit}
        row |= {"trains_verdict": test.finding["verdict"], "trains_term": test.finding["term"]}
        if test.finding["term"] == names[0]:
            row["parameters_json"] = test.finding["parameters_json"]
    if names and answer.gain is not None and nats < threshold:
        evidence = f"the most likely one has {nats:.1f} of the {threshold:g} nats (log odds) of evidence needed"
        words = f"no effect is named; {evidence}: {sentence_of(row, n_with_trains)}"
        return row | {"verdict": "none", "term": None, "rival_term": None, "component": None, "sentence": words}
    return row | {"sentence": sentence_of(row, n_with_trains)}
