"""Describe one hammer test in words, from the rows that the hammer stage makes for the registry."""

from __future__ import annotations

from collections import Counter
from math import floor
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import REMARK_REASONS
from turnout.hammer_test.dynamic_stiffness import dynamic_stiffness
from turnout.reasons import REASONS
from turnout.report.formatting import sorted_statements, with_interval
from turnout.report.pages.turnout import BANDS, PANELS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from typing import Any

    from turnout.config.settings.receptance import ReceptanceSettings
    from turnout.config.turnout import HammerConfig, TurnoutConfig
    from turnout.records import Unit

VERDICTS = {
    "accepted": "both resonances found",
    "second_order_only": "one of the two resonances found",
    "rejected": "no resonance found",
}


def verdict(rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    """Result of a test in a few words.

    Parameters
    ----------
    rows : mapping
        Rows of ``hammer_unit`` by table.

    Returns
    -------
    str
        The words.

    Examples
    --------
    >>> verdict({"recordings": [], "quarantine": [{}]})
    'nothing could be used'
    """
    models = rows.get("models")
    return VERDICTS[models[0]["status"]] if models else "nothing could be used"


def is_usable(rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> bool:
    """Whether at least one resonance is accepted.

    Parameters
    ----------
    rows : mapping
        Rows of ``hammer_unit`` by table.

    Returns
    -------
    bool
        False also without a model.
    """
    return any(model["status"] != "rejected" for model in rows.get("models", ()))


def heading(unit: Unit, turnout: TurnoutConfig) -> str:
    """Turnout, section with its position, and campaign.

    Parameters
    ----------
    unit : Unit
        Section and campaign.
    turnout : TurnoutConfig
        The turnout.

    Returns
    -------
    str
        The words.
    """
    section = turnout.section(str(unit.section))
    track = "both tracks" if section.track == "both" else f"{section.track} track" if section.track else ""
    details = [PANELS.get(section.panel), track, f"{section.position:g} m"]
    return f"{turnout.id}, section {section.label} ({', '.join(p for p in details if p)}), campaign {unit.campaign}"


def hammer_words(
    rows: Mapping[str, Sequence[Mapping[str, Any]]], unit: Unit, turnout: TurnoutConfig, remarks: Iterable[str] = ()
) -> list[str]:
    """Lines of text: files read, impacts accepted, coherence, resonances or why there is none.

    Parameters
    ----------
    rows : mapping
        Rows of ``hammer_unit`` by table.
    unit : Unit
        Section and campaign.
    turnout : TurnoutConfig
        The turnout.
    remarks : iterable of str
        Notes that are added at the end.

    Returns
    -------
    list of str
        The lines.
    """
    lines = [f"{heading(unit, turnout)}: {verdict(rows)}"]
    names = _names(rows.get("recordings", ()))
    lines += [_line("read", _file(row, names[row["recording_id"]])) for row in rows.get("recordings", ())]
    if rows.get("recordings") and turnout.hammer is not None:
        lines.append(_line("channels", _channels(turnout.hammer, str(unit.section))))
    lines += _quarantine_lines(rows.get("quarantine", ()))
    if rows.get("models"):
        lines += (
            _impact_lines(rows, turnout.settings["receptance"])
            if rows.get("impacts")
            else [_line("impacts", "none could be judged: the files hold averaged frequency responses")]
        )
        lines += _gate_lines(rows, turnout.settings)
        lines += [line for band in _bands(rows) for line in _resonance_lines(band, rows)]
        lines += _reason_lines(rows["models"][0])
        lines.append(_line("rail", _temperature(rows, unit, turnout)))
    return lines + [_line("note", remark) for remark in remarks]


def resonances(rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[str]:
    """A few words for each mode: band, frequency and damping with their 95 % intervals.

    Parameters
    ----------
    rows : mapping
        Rows of ``hammer_unit`` by table.

    Returns
    -------
    list of str
        One text for each mode.
    """
    return [f"{mode['band']} {_mode(mode)}" for mode in rows.get("modes", ())]


def _line(what: str, words: str) -> str:
    return f"  {what:<10} {words}"


def _names(recordings: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """File names by recording id; with their folders where two have the same name."""
    short = {row["recording_id"]: row["path"].rsplit("/", 1)[-1] for row in recordings}
    count = Counter(short.values())
    return {
        row["recording_id"]: name if count[name := short[row["recording_id"]]] == 1 else row["path"]
        for row in recordings
    }


def _file(row: Mapping[str, Any], name: str) -> str:
    one = "1 record" if row["n_records"] == 1 else f"{row['n_records']} records"
    if not row["sampling_rate_hz"]:
        return f"{name}: {row['n_channels']} frequency responses of {row['n_samples']} lines, {row['file_format']}"
    length = row["n_samples"] / row["sampling_rate_hz"]
    return f"{name}: {one} of {length:.3g} s at {row['sampling_rate_hz']:g} Hz, {row['file_format']}"


def _channels(hammer: HammerConfig, section: str) -> str:
    channels = {channel.name: channel for channel in hammer.descriptions[section].channels}
    descriptions = []
    for what, name in (("force", hammer.force[section]), ("response", hammer.response[section])):
        channel = channels[name]
        unit = f" [{channel.unit}]" if channel.unit else ""
        descriptions.append(
            f"{what} from {channel.source!r}{unit}{f', {channel.mounting}' if channel.mounting else ''}"
        )
    return "; ".join(descriptions)


def _quarantine_lines(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """A line for each file or record that is not used; records of a file with the same problem share one.

    A file with another time in its name than inside is used and has a line, too, as any with a remark.
    """
    groups: dict[tuple, list] = {}
    for row in rows:
        groups.setdefault((row["path"], row["reason_code"], row["found"], row["remedy"]), []).append(row["place"])
    lines = []
    for (path, reason, finding, remedy), positions in groups.items():
        more = f" ({len(positions)} such places, the last: {positions[-1]})" if len(positions) > 1 else ""
        what = "note" if reason in REMARK_REASONS else "not used"
        lines.append(_line(what, f"{path}, {positions[0]}: {finding}{more}. {remedy}."))
    return lines


def _impact_lines(rows: Mapping[str, Sequence[Mapping[str, Any]]], settings: ReceptanceSettings) -> list[str]:
    """A line for each impact with its verdict; they are counted from 1."""
    names = _names(rows["recordings"])
    impacts = rows["impacts"]
    used = sum(impact["status"] == "accepted" for impact in impacts)
    lines = [_line("impacts", f"{used} of {len(impacts)} accepted, {settings.minimum_impacts} are needed")]
    width = max(map(len, (*names.values(), "file")))
    lines.append(_line("", f"{'file':<{width}} no.  {'peak':>9}  {'contact':>8}  verdict"))
    for impact in impacts:
        force, contact = (_number(impact[c], d) for c, d in (("peak_n", 1e3), ("contact_ms", 1.0)))
        name = f"{names[impact['recording_id']]:<{width}} {impact['record'] + 1:>3}"
        lines.append(_line("", f"{name}  {force:>6} kN  {contact:>5} ms  {_impact_verdict(impact)}"))
    return lines


def _number(value: float | None, divisor: float) -> str:
    if value is None or not np.isfinite(value):
        return "–"
    size = value / divisor
    return f"{size:.2f}" if abs(size) >= 0.1 else f"{size:.2g}"


def _impact_verdict(impact: Mapping[str, Any]) -> str:
    if impact["status"] == "accepted":
        return "accepted" + (f", {impact['detail']}" if impact["detail"] else "")
    return f"rejected, {impact['reason']}: {impact['detail']}"


def _gate_lines(rows: Mapping[str, Sequence[Mapping[str, Any]]], settings: Mapping[str, Any]) -> list[str]:
    """Lines about the coherence and the share of lines that pass the gate; none without a receptance."""
    if not rows.get("receptances"):
        return []
    row, receptance_settings = rows["receptances"][0], settings["receptance"]
    lowest = rows["models"][0]["coherence_minimum"]
    limit_words, compared = "", "its lower 95 % limit"
    if lowest is not None:
        limit_words = f"{compared} is {floor(1e3 * lowest) / 1e3:.3f} or more around the resonances; "
        compared = "that limit"
    compared = compared if row["gate"] == "limit" else "the coherence itself"
    lines = [
        _line("coherence", f"{limit_words}the gate needs {compared} at {receptance_settings.gate_level:g} or more")
    ]
    frequency, passed = np.asarray(row["frequency_hz"]), np.asarray(row["passed"], dtype=bool)
    shares = []
    for _, low, high in settings["identify"].bands():
        inside = (frequency >= low) & (frequency < high)
        share = 100.0 * np.mean(passed[inside]) if inside.any() else 0.0
        shares.append(f"{share:.0f} % of {low:g}-{high:g} Hz")
    return [*lines, _line("gate", f"lets pass {', '.join(shares)}; the hammer reaches to {row['valid_to_hz']:.0f} Hz")]


def _bands(rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[str]:
    """The two main bands, and others with a resonance."""
    return [*BANDS, *(mode["band"] for mode in rows.get("modes", ()) if mode["band"] not in BANDS)]


def _resonance_lines(band: str, rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[str]:
    mode = next((mode for mode in rows.get("modes", ()) if mode["band"] == band), None)
    if mode is None:
        return [_line(band, "none")]
    return [_line(band, _mode(mode)), *_stiffness_lines(mode, rows)]


def _mode(mode: Mapping[str, Any]) -> str:
    n = mode["n_impacts"]
    frequency = with_interval(mode["frequency_hz"], mode["frequency_se_hz"], n)
    return f"{frequency} Hz, damping {with_interval(mode['damping_ratio'], mode['damping_se'], n, 4)}, n = {n}"


def _stiffness_lines(mode: Mapping[str, Any], rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[str]:
    """Dynamic stiffness at the resonance; not with an exponential window, which changes it."""
    row = next(iter(rows.get("receptances", ())), None)
    if row is None or row["window_decay_per_s"]:
        return []
    frequency = np.asarray(row["frequency_hz"], dtype=float)
    h1 = np.asarray(row["h1_real_m_n"], dtype=float) + 1j * np.asarray(row["h1_imag_m_n"], dtype=float)
    stiffness = dynamic_stiffness(
        frequency, h1, row["coherence"], row["passed"], row["n_impacts"], float(mode["frequency_hz"])
    )
    if stiffness is None:
        return []
    value, low, high = (f"{v / 1e6:#.4g}" for v in stiffness)
    return [_line("", f"dynamic stiffness at {mode['frequency_hz']:.1f} Hz {value} MN/m ({low} to {high}, 95 %)")]


def _reason_lines(model: Mapping[str, Any]) -> list[str]:
    """Why the model was rejected or has one resonance only, or else its detail; a line for each statement."""
    statements = sorted_statements(model["detail"])
    if model["reason"]:
        return [_line("why", REASONS[model["reason"]]), *(_line("", statement) for statement in statements)]
    lines = [_line("" if k else "detail", statement) for k, statement in enumerate(statements)]
    return lines if model["detail"] else []


def _temperature(rows: Mapping[str, Sequence[Mapping[str, Any]]], unit: Unit, turnout: TurnoutConfig) -> str:
    from_notes = turnout.campaigns[str(unit.campaign)].rail_temperature
    from_file = next((mode["rail_temperature_c"] for mode in rows.get("modes", ())), None)
    if from_notes is not None:
        return f"{from_notes:g} °C, noted in campaigns.csv"
    if from_file is not None:
        return f"{from_file:g} °C, noted in the file"
    return "temperature not noted in campaigns.csv" + (
        " nor in the file: no chart judges a campaign without one, note it there" if rows.get("modes") else ""
    )
