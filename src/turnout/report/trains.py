"""Prepare the trains section of a turnout's page: passages, scores by section, effects of type, speed and load."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

from turnout.config.settings.trend import TrendSettings
from turnout.constants import Z95
from turnout.counts import count_of
from turnout.registry.schema import literal
from turnout.report.panels.train_bars import train_bars
from turnout.report.panels.weekly_peaks import weekly_peaks_panel

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from typing import Any

# DuckDB pushes a condition on a constant list down to the files, below window functions of the views; not a subquery.
ROWS = {
    "scores": """
        select
            turnout_id, section_id, status, count(*) as n, count(forecast_others_pct) as n_compared,
            count(*) filter (forecast_pct > forecast_others_pct) as n_best,
            count(*) filter (chi_squared_failed_share > 0.5 and along_b_share < 0.8) as n_no_impulse
        from passage_scores where turnout_id in ({own}) group by all""",
    "weeks": """
        select
            v.turnout_id, v.section_id, v.measured_at_utc as week_utc, v.frequency_hz as peak_ms2,
            v.frequency_se_hz as peak_se_ms2, c.state,
            half_band_pct(c.residual_pct, c.z, b.phi, b.guard, b.sd_pct) as half_pct,
            v.frequency_hz - b.acceleration_ms2 / 100 * (c.residual_pct + half_pct) as expected_low_ms2,
            v.frequency_hz - b.acceleration_ms2 / 100 * (c.residual_pct - half_pct) as expected_high_ms2
        from passage_values v
        left join {charts} c on c.section_id = v.section_id and c.band = v.band and c.source = v.source
            and c.measured_at_utc = v.measured_at_utc
        left join {baselines} b on b.section_id = c.section_id and b.band = c.band and b.source = c.source
            and b.epoch = c.epoch
        where v.band = 'amplitude' and v.turnout_id in ({own}) order by v.section_id, week_utc""",
    "bars": "select * from fit_adjusted where turnout_id in ({own}) order by section_id, factor, class_from, class",
    "effects": "select * from fit_effects where turnout_id in ({own}) order by section_id, factor",
    "passages": """
        select * from passages_current where turnout_id in ({own})
        qualify row_number() over (partition by turnout_id order by passed_at_utc desc) <= 15
        order by passed_at_utc desc""",
}
# Stand for the tables of charts and baselines before the first trend.
NO_CHARTS = """(
    select null::varchar as section_id, null as band, null as source, null::timestamp as measured_at_utc,
        null::varchar as state, null::double as residual_pct, null::double as z, null::integer as epoch
    where false)"""
NO_BASELINES = """(
    select null::varchar as section_id, null as band, null as source, null::integer as epoch, null::double as phi,
        null::double as guard, null::double as sd_pct, null::double as acceleration_ms2
    where false)"""
MEASURED_SOURCES = ("recording", "both")  # axle_load_source of a load from the sensors, not from trains.csv
FACTORS = ("train type", "speed", "axle load")
SCORES = ("fit", "forecast")


def train_rows(
    fetch: Callable[[str], list[dict[str, Any]]], turnout_ids: Iterable[str], has_charts: bool = True
) -> dict[str, dict[str, list[dict[str, Any]]]]:
    """Rows that ``trains_part`` needs.

    Parameters
    ----------
    fetch : callable
        Runs SQL and returns its rows.
    turnout_ids : iterable of str
        Ids of turnouts.
    has_charts : bool
        Whether the registry has the table ``charts``, which the first trend makes.

    Returns
    -------
    dict
        Rows by table and turnout id: {table: {turnout_id: [row, ...]}}.
    """
    ids = ", ".join(literal(t) for t in turnout_ids)
    names = ("charts", "baselines") if has_charts else (NO_CHARTS, NO_BASELINES)
    trend_tables = dict(zip(("charts", "baselines"), names))
    rows_by_table: dict[str, dict[str, list[dict[str, Any]]]] = {}
    for table, sql in ROWS.items():
        grouped = defaultdict(list)
        for row in fetch(sql.format(own=ids, **trend_tables)) if ids else ():
            grouped[row["turnout_id"]].append(row)
        rows_by_table[table] = grouped
    return rows_by_table


def trains_part(
    rows: Mapping[str, Sequence[Mapping[str, Any]]], sections: Sequence[Mapping[str, Any]]
) -> dict[str, Any] | None:
    """Variables of the template for the trains of one turnout.

    Parameters
    ----------
    rows : mapping
        Rows of ``train_rows`` of this turnout, by table.
    sections : sequence of mapping
        Rows of ``sections``, in the order along the track.

    Returns
    -------
    dict or None
        Variables of the template; None without a recorded passage.
    """
    if not rows["passages"]:
        return None
    charts = {
        score: "".join(train_bars(f, [b for b in rows["bars"] if b["score"] == score], sections) for f in FACTORS)
        for score in SCORES
    }
    return {
        "passages": [_passage(p) for p in rows["passages"]],
        "words": score_words(rows["scores"]),
        "weeks": "".join(
            weekly_peaks_panel(s["label"], [w for w in rows["weeks"] if w["section_id"] == s["section_id"]])
            for s in sections
        ),
        "target": f"{TrendSettings().target_acceleration_percent:g}",
        "n_scores": sum(s["n"] for s in rows["scores"]),
        "n_beyond": sum(s["n"] for s in rows["scores"] if s["status"] in ("accepted", "not_an_impulse")),
        "charts": charts,
        "loads_known": any(b["factor"] == "axle load" for b in rows["bars"]),
        "effects": [_effect(e) for e in rows["effects"] if e["score"] == "fit"],
    }


def score_words(scores: Sequence[Mapping[str, Any]]) -> str:
    """Sentences on how many scores are better than those of random models and of other sections.

    Parameters
    ----------
    scores : sequence of mapping
        Number of scores by section and status.

    Returns
    -------
    str
        Sentences, "" without a score.
    """
    if not scores:
        return ""
    n = sum(s["n"] for s in scores)
    count = {status: sum(s["n"] for s in scores if s["status"] == status) for status in {s["status"] for s in scores}}
    sentences = [
        f"{count_of(n, 'record')} of single sensors, compared with the model of the section.",
        f"Better than random models, and the wheels act as impacts: {count.get('accepted', 0)}.",
        f"Better than random models, but the wheels do not act as impacts: {count.get('not_an_impulse', 0)}.",
        f"No better than random models: {count.get('null_explains', 0)}.",
    ]
    rolling = sum(s["n_no_impulse"] for s in scores)
    if rolling:
        sentences.append(
            f"In {count_of(rolling, 'record')} the wheels are no single impacts: they load the rail all the time."
        )
    n_compared, n_best = (sum(s[k] for s in scores) for k in ("n_compared", "n_best"))
    if n_compared:
        sentences.append(
            f"The model of the section itself predicts more than that of any other section in {n_best} of {n_compared}."
        )
    sentences.append("A score that random models reach carries no information about the track, neither good nor bad.")
    return " ".join(sentences)


def _passage(passage: Mapping[str, Any]) -> dict[str, Any]:
    """One passage in words."""
    load, load_error = passage["axle_load_t"], passage["axle_load_se_t"]
    is_measured = load is not None and passage["axle_load_source"] in MEASURED_SOURCES
    listed = (
        (passage["speed_listed_kmh"], "{:g} km/h"),
        (passage["train_type_listed"], "{}"),
        (passage["axle_load_listed_t"], "{:.1f} t"),
    )
    return {
        "when": f"{passage['passed_at_utc']:%Y-%m-%d %H:%M}",
        "type": passage["train_type"] or "unknown",
        "listed": ", ".join(text.format(value) for value, text in listed if value) or "–",
        "axles": passage["n_axles"] or "–",
        "speed": "–" if passage["speed_kmh"] is None else _with_error(passage["speed_kmh"], passage["speed_se_kmh"]),
        "load": _with_error(load, load_error) if is_measured else "not measured",
        "way": f"{passage['direction'] or 'unknown'}, {passage['track'] or 'unknown'}",
        "status": passage["status"] + (f": {passage['detail']}" if passage["detail"] else ""),
    }


def _with_error(value: float, standard_error: float | None) -> str:
    return f"{value:.1f} ± {'?' if standard_error is None else f'{Z95 * standard_error:.1f}'}"


def _effect(effect: Mapping[str, Any]) -> dict[str, Any]:
    """One effect in words, and whether its interval contains zero."""
    clear = effect["low_pct"] > 0 or effect["high_pct"] < 0
    return {
        "section": effect["section_id"].split("/")[-1],
        "factor": f"{effect['factor']}, per {effect['per']}",
        "n": effect["n"],
        "raw": "–" if effect["raw_change_pct"] is None else f"{effect['raw_change_pct']:+z.2f}",
        "held": f"{effect['change_pct']:+z.2f} [{effect['low_pct']:+z.2f}, {effect['high_pct']:+z.2f}]",
        "fixed": effect["held_fixed"],
        "verdict": "differs from none" if clear else "cannot be distinguished from none",
    }
