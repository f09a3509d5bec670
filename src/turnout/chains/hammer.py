"""Hammer tests of one section and campaign: raw files in, rows of the registry out."""

from collections import Counter
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from turnout.chains.hammer_rows import impact_mode_row, impact_row, mode_row, model_row, receptance_row
from turnout.chains.noted import rail_temperature
from turnout.chains.raw_rows import quarantine_row, read_or_quarantine, recording_row
from turnout.config.pattern import compiled
from turnout.config.turnout import TurnoutConfig
from turnout.errors import ReadError
from turnout.identify import identify
from turnout.receptance import find_impacts, receptance_of
from turnout.records import ModalModel, Rejection, Unit
from turnout.registry.ids import content_id


def hammer_unit(unit: Unit, turnout: TurnoutConfig, raw_root, algo: str = "") -> dict[str, list[dict]]:
    """Rows by table for one section and campaign.

    A file that cannot be read, or one damaged record of a sound file, becomes a quarantine row; the rest is
    used. An impact that is not good enough becomes a row with its reason. Too few impacts, a failed gate or
    no stable mode give a model row with status "rejected".

    Parameters
    ----------
    unit : Unit
        The test files of one section and campaign.
    turnout : TurnoutConfig
        Merged configuration of the turnout, with its campaigns.
    raw_root : path
        Folder that the paths of ``unit.files`` start from.
    algo : str
        Version of the code, part of the model's id.
    """
    if unit.section is None or unit.campaign is None or turnout.hammer is None:
        raise ValueError(f"{unit.turnout}/{unit.label} is no unit of hammer tests")
    campaign = turnout.campaigns[unit.campaign]
    base = {
        "turnout_id": unit.turnout,
        "section_id": turnout.section_id(unit.section),
        "campaign_id": f"{unit.turnout}/{unit.campaign}",
    }
    rows: dict[str, list[dict]] = {"recordings": [], "impacts": [], "quarantine": []}
    description = turnout.hammer.descriptions[unit.section]
    force, response = turnout.hammer.force[unit.section], turnout.hammer.response[unit.section]
    recordings: list = []
    ids: dict[str, str] = {}
    for path, size, _ in unit.files:
        result = read_or_quarantine(path, raw_root, description, base, rows["quarantine"], "hammer", ids)
        if result is not None:
            ids[path] = result.sha256[:32]
            rows["recordings"].append(recording_row(result, path, size, description, base, "hammer"))
            recordings += result.recordings
    if not rows["recordings"]:
        return rows
    recordings = _of_one_rate(recordings, base, rows["quarantine"], ids)
    # all blows of the campaign at once: what is wrong with a whole file shows against the others
    impacts = find_impacts(recordings, force, response, turnout.settings["receptance"])
    names = [f"{ids[impact.source]}:{impact.record}" for impact in impacts]
    tests = {path: _test_number(turnout, unit, path) for path in ids}
    rows["impacts"] = [impact_row(i, base, tests[i.source], ids[i.source]) for i in impacts]
    temperature = campaign.rail_temperature
    if temperature is None:
        temperature = rail_temperature(recordings)
    inputs = sorted(r["recording_id"] for r in rows["recordings"])
    identity = {
        "model_id": content_id(
            "model", *inputs, base["section_id"], unit.config_hash, algo, campaign.started_at, temperature
        ),
        "measured_at_utc": campaign.started_at,
        "code_version": algo,
        "config_hash": unit.config_hash,
    }
    return rows | _modal_rows(impacts, names, turnout, base, identity, temperature)


def _of_one_rate(recordings, base, quarantine, ids):
    """The recordings of the rate that most have; a quarantine row for each file of another one."""
    rates = Counter(r.rate for r in recordings)
    most = max(rates, key=lambda rate: (rates[rate], rate))
    for path in sorted({r.source for r in recordings if r.rate != most}):
        rate = next(r.rate for r in recordings if r.source == path)
        found, remedy = f"{rate:g} Hz, the others {most:g} Hz", "Record all tests of a campaign at one rate"
        error = ReadError(path, "the file", found, remedy, "wrong_rate")
        quarantine.append(quarantine_row(error, base, "hammer", "hammer", None, ids[path]))
    return [r for r in recordings if r.rate == most]


def _modal_rows(impacts, names, turnout, base, identity, temperature):
    """Rows of models, modes, impact_modes and receptances."""
    used = [(impact, name) for impact, name in zip(impacts, names) if impact.accepted]
    settings, n_rejected = turnout.settings["identify"], len(impacts) - len(used)
    needed = turnout.settings["receptance"].minimum_impacts
    if len(used) < needed:
        model = _too_few(len(used), needed, impacts)
        return {"models": [model_row(model, base, identity, (len(used), n_rejected), None)], "modes": []}
    accepted = [impact for impact, _ in used]
    receptance = receptance_of(accepted, turnout.settings["receptance"])
    decays = [impact.decay for impact in accepted]
    leads: dict[str, Any] = (
        {"leads": [i.acceleration[: i.decay_start] for i in accepted]} if settings.method == "paper" else {}
    )
    model = identify(decays, accepted[0].rate, settings, receptance, **leads)
    return {
        "models": [model_row(model, base, identity, (len(used), n_rejected), _lowest(receptance, model))],
        "modes": [mode_row(mode, base, identity, temperature) for mode in model.modes],
        "impact_modes": [impact_mode_row(e, base, identity, used[e["impact"]][1]) for e in model.per_impact],
        "receptances": [receptance_row(receptance, model, decays[0], base, identity)],
    }


def _test_number(turnout, unit, path):
    """Number of the test from the file's name, 0 where the pattern has none or it is no number."""
    inside = str(PurePosixPath(path).relative_to(turnout.raw))
    labels = tuple(s.label for s in turnout.sections)
    match = compiled(turnout.hammer.files, "hammer", labels).fullmatch(inside)
    number = (match.groupdict().get("test") or "0") if match else "0"
    return int(number) if number.isdigit() else 0


def _too_few(n, needed, impacts):
    """A rejected model without modes: it says how many impacts were left, and why the others went."""
    reasons = sorted({r.reason for i in impacts for r in i.rejections})
    words = f"{n} of {len(impacts)} impacts accepted, {needed} needed"
    if reasons:
        words += f"; rejected for {', '.join(reasons)}"
    rejection = Rejection("too_few_impacts", float(n), float(needed), words)
    empty = np.zeros(0)
    return ModalModel(
        np.zeros((0, 0)), empty, empty, impacts[0].rate if impacts else 1.0, (), status="rejected",
        rejections=(rejection,),
    )  # fmt: skip


def _lowest(receptance, model):
    """Lowest gate level within the half-power bandwidth of the modes, None without modes."""
    lowest = []
    for mode in model.modes:
        half = max(mode.damping, 0.02) * mode.frequency
        near = np.abs(receptance.frequency - mode.frequency) <= half
        if near.any():
            lowest.append(float(np.nanmin(receptance.gate_level[near])))
    return min(lowest) if lowest else None
