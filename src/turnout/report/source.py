"""Query the registry for the pages: sums for the fleet, whole rows for some turnouts at a time."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

from turnout.config.settings.trend import TrendSettings
from turnout.constants import Z95_EXACT
from turnout.registry.as_of import list_day, whole_list
from turnout.report.trains import train_rows

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping
    from typing import Any

    import duckdb

BASELINE = TrendSettings()  # of which the page states what a baseline needs
# One row per section: that of the newest model, accepted or not.
NEWEST_MODEL = "qualify row_number() over (partition by section_id order by measured_at_utc desc, model_id) = 1"
COMMON_PARAMETERS = "(ballast|pad)_stiffness"  # of the calibrated model, of all supports
ID_GIVEN = "turnout_id in (select unnest($turnouts))"
# Scatter between the campaigns of each section, which needs all campaigns of the fleet: read once, for all turnouts.
HISTORY = "mode_scatter_read"
# Campaign of each model, whose name is the local day: its start in UTC may lie on the day before.
CAMPAIGNS = f"(select model_id, campaign_id from models_current where {ID_GIVEN})"
MIN_TRACK = 8  # earlier campaigns from which on a page names a mode off the track; quartiles of fewer are too uncertain
MAX_QUARANTINE_ROWS = 20  # quarantine rows of one reason that a page shows
# Effect, parameter, size [m, -] of which a page says when it is reached, and whether it falls to it (docs/mismatch.md)
SIZE_LIMITS = (
    ("hanging_sleeper", "gap", 0.002, False),
    ("surface_dip", "depth", 0.001, False),
    ("local_ballast", "factor", 0.5, True),
    ("local_pad", "factor", 0.5, True),
)
LIMIT_SQL = f"""
    select turnout_id, finding_id, '{{effect}}' as term, position_m, words
    from growth_to_limit(effect := '{{effect}}', quantity := '{{quantity}}', size_limit := {{size}},
        falls := {{falls}})
    where {ID_GIVEN} and abs(per_year) > {Z95_EXACT} * per_year_se and forecast <> 'never'
        and {{falls}} = (per_year < 0)"""
ROWS = {
    "turnouts": f"select * from turnouts where {ID_GIVEN}",
    "sections": f"select * from sections where {ID_GIVEN} order by position_m, label",
    "events": f"select * from events where {ID_GIVEN} order by event_at_utc, event_id",
    "modes": f"""
        with intervals as (
            select m.*,
                history_half_width(frequency_repeatability_hz / frequency_hz, f.between_sd, f.freedom) as f_half,
                history_half_width(damping_repeatability / damping_ratio, d.between_sd, d.freedom) as d_half,
                f.n_steps as frequency_steps, d.n_steps as damping_steps
            from modes_current m
            left join {HISTORY} f on f.section_id = m.section_id and f.band = m.band and f.quantity = 'frequency'
            left join {HISTORY} d on d.section_id = m.section_id and d.band = m.band and d.quantity = 'damping'
            where m.band in ('ballast', 'railpad') and m.source = 'hammer' and {ID_GIVEN}
        )
        select turnout_id, section_id, model_id, campaign_id, band, measured_at_utc, frequency_hz, frequency_se_hz,
            damping_ratio, damping_se, n_impacts, rail_temperature_c, frequency_steps, damping_steps,
            frequency_hz * exp(-f_half) as frequency_low_hz, frequency_hz * exp(f_half) as frequency_high_hz,
            damping_ratio * exp(-d_half) as damping_low, damping_ratio * exp(d_half) as damping_high
        from intervals left join {CAMPAIGNS} using (model_id) order by section_id, band, measured_at_utc""",
    "models": f"select * from models_current where {ID_GIVEN} {NEWEST_MODEL}",
    "unused": f"""
        select turnout_id, section_id, campaign_id, measured_at_utc, reason, detail
        from (
            select *, max(measured_at_utc) over (partition by section_id) as newest_utc
            from models_current where {ID_GIVEN}
        )
        where status = 'rejected' and coalesce(method, 'joint') = 'joint' and measured_at_utc < newest_utc
        order by section_id, measured_at_utc desc, model_id""",
    "off_track": f"""
        select turnout_id, section_id, campaign_id, band, measured_at_utc, frequency_hz, frequency_track_hz,
            damping_ratio, damping_track, residue_ratio, n_history, shape_mac, verdict, frequency_se_hz, damping_se,
            frequency_distance, damping_distance
        from modes_off_track left join {CAMPAIGNS} using (model_id)
        where {ID_GIVEN} and n_history >= {MIN_TRACK}
        order by section_id, measured_at_utc desc, band""",
    "receptances": f"select * from receptances_current where {ID_GIVEN} {NEWEST_MODEL}",
    "impacts": f"""
        select i.turnout_id, i.section_id, i.test, i.record, i.status, i.reason, i.detail, i.peak_n
        from impacts_current i
        join (
            select section_id, max(campaign_id) as campaign_id from impacts_current where {ID_GIVEN} group by section_id
        ) newest using (section_id, campaign_id)
        where i.{ID_GIVEN}
        order by i.section_id, i.test, i.record""",
    # of each reason the newest by name, because a sensor may be dead for years; of a remark on the layout one for all
    "quarantine": f"""
        select *, count(*) over (partition by turnout_id, kind, reason_code) as n_alike
        from quarantine_open where {ID_GIVEN}
        qualify row_number() over (
            partition by turnout_id, kind, reason_code order by path desc, record desc
        ) <= {MAX_QUARANTINE_ROWS} and (reason_code <> 'entry_unknown' or row_number() over (
            partition by turnout_id, kind, reason_code, remedy order by path desc, record desc
        ) = 1)
        order by path, record""",
    "charts": f"""
        select turnout_id, section_id, band, measured_at_utc, expected_low_hz, expected_high_hz, state, deviation_pct
        from charts where source = 'hammer' and {ID_GIVEN} order by section_id, band, measured_at_utc""",
    "damping_charts": f"""
        select turnout_id, section_id, band, measured_at_utc, expected_low_damping, expected_high_damping, state
        from damping_charts where source = 'hammer' and {ID_GIVEN} order by section_id, band, measured_at_utc""",
    "recursive_modes": f"""
        select turnout_id, section_id, band, measured_at_utc, frequency_recursive_hz, damping_recursive
        from recursive_modes where source = 'hammer' and {ID_GIVEN} order by section_id, band, measured_at_utc""",
    "chart_states": f"select * from chart_states_on(:today) where {ID_GIVEN}",
    "mismatches": f"select * from findings_newest where {ID_GIVEN} and verdict <> 'none' order by level_before desc",
    "limits": " union all ".join(
        LIMIT_SQL.format(effect=e, quantity=q, size=size, falls=falls) for e, q, size, falls in SIZE_LIMITS
    )
    + " order by position_m, term",
    "calibrated": f"""
        select turnout_id, finding_id, visit, found_at_utc, parameter, position_m, value, sd, prior_sd, n_visits,
            n_recordings
        from twin_states anti join superseded on finding_id = old_id
        where {ID_GIVEN} and (position_m is not null or regexp_matches(parameter, '{COMMON_PARAMETERS}$'))
            and found_at_utc >= coalesce((
                select max(event_at_utc) from events e
                where e.turnout_id = twin_states.turnout_id and kind = 'renewal' and section_id is null
                    and event_at_utc < :today + interval 1 day
            ), '-infinity'::timestamp)
        order by found_at_utc, parameter_no""",
    "worklist": f"select * from {whole_list(':today')} where {ID_GIVEN} order by rank",
}
TURNOUTS = f"""
    with models as (
        select turnout_id, max(measured_at_utc) as latest, max_by(campaign_id, measured_at_utc) as campaign_id,
            count(*) filter (where status <> 'rejected') as n_models
        from (select * from models_current {NEWEST_MODEL}) group by turnout_id
    ),
    sections as (select turnout_id, count(*) as n_sections from sections group by turnout_id),
    rejected as (
        select turnout_id, count(*) as n_rejected from impacts_current where status = 'rejected' group by turnout_id
    ),
    quarantined as (
        select turnout_id, count(*) as n_quarantined from quarantine_open where not is_remark group by turnout_id
    )
    select t.*, m.latest, m.campaign_id, coalesce(m.n_models, 0) as n_models, coalesce(s.n_sections, 0) as n_sections,
        coalesce(r.n_rejected, 0) as n_rejected, coalesce(q.n_quarantined, 0) as n_quarantined
    from turnouts t left join models m using (turnout_id) left join sections s using (turnout_id)
        left join rejected r using (turnout_id) left join quarantined q using (turnout_id)
    order by turnout_id
"""
REASONS = """
    select reason, sum(impacts) as impacts, sum(rows) as rows from (
        select reason, count(*) as impacts, 0 as rows from impacts_current where status = 'rejected' group by reason
        union all
        select reason_code, 0, count(*) from quarantine_open where not is_remark group by reason_code
    ) group by reason order by sum(impacts) + sum(rows) desc, reason
"""
# How much the stiffness (the square of a frequency) changes in ten years at the present drift, at least, in per cent.
# A section with a step has no drift: a slope through the step would continue it.
SCORES = """
    select turnout_id, max(score) filter (not is_stepped) as score,
        max_by(section_id, score) filter (not is_stepped) as section_id,
        max_by(band, score) filter (not is_stepped) as band
    from (
        select turnout_id, section_id, band,
            bool_or(coalesce(change_kind = 'step', false)) over (partition by turnout_id, section_id) as is_stepped,
            100 * (1 - exp(-0.2 * greatest(abs(drift_pct_per_year) - 1.96 * drift_se_pct_per_year, 0))) as score
        from chart_states_on(:today)
        where band in ('ballast', 'railpad') and drift_pct_per_year is not null and drift_se_pct_per_year is not null
    )
    group by turnout_id
    having not bool_or(is_stepped) or max(score) filter (not is_stepped) >= 0.5
"""
TREND_VIEWS = {"charts", "damping_charts", "chart_states", "worklist"}


class FleetSource:
    """Rows of the registry as dictionaries, of the fleet or of some turnouts (``rows_of``).

    States and worklist are those of ``day`` (YYYY-MM-DD), by default of today.
    """

    def __init__(self, connection: duckdb.DuckDBPyConnection, day: str | None = None) -> None:
        self.connection, self.day = connection, list_day(connection, day)
        rows = connection.execute("select view_name from duckdb_views() where database_name = current_database()")
        self.views = {row[0] for row in rows.fetchall()}
        self._has_history = False

    def turnouts(self) -> list[dict[str, Any]]:
        """One row per turnout with its counts."""
        return self._fetch(TURNOUTS)

    def reasons(self) -> list[dict[str, Any]]:
        """Number of impacts and quarantine rows by reason."""
        return self._fetch(REASONS)

    def states(self) -> list[dict[str, Any]]:
        """Number of charts by turnout and state; empty before the first trend."""
        sql = "select turnout_id, state, count(*) as n from chart_states_on(:today) group by all order by all"
        return self._fetch(sql) if self.has("chart_states") else []

    def chart_kinds(self) -> list[dict[str, Any]]:
        """Number of charts by what they follow: "resonance", "damping" or "amplitude" of a section, "whole turnout"."""
        sql = """select case when section_id = '*' then 'whole turnout' when contains(band, 'damping') then 'damping'
            when band in ('ballast', 'railpad') then 'resonance' else 'amplitude' end as kind, count(*) as n
            from chart_states_on(:today) group by all order by n desc, kind"""
        return self._fetch(sql) if self.has("chart_states") else []

    def learning(self) -> dict[str, Any]:
        """Numbers of charts without a baseline yet (``n``), and of those that learn again after work (``n_again``).

        ``n_campaigns`` and ``n_days`` are what the most advanced baseline has, that with the least part still missing.
        """
        if not self.has("chart_states"):
            return {"n": 0, "n_again": 0, "n_campaigns": 0, "n_days": 0}
        sql = f"""
            with since as (
                select turnout_id, section_id, band, source, min(measured_at_utc) as first_utc,
                    max(measured_at_utc) as last_utc
                from charts where state in ('baseline', 'learning') group by all
            ),
            known as (
                select c.reason, coalesce(s.n_baseline, 0) as has_campaigns,
                    coalesce(date_diff('day', first_utc, last_utc), 0) as has_days
                from chart_states_on(:today) c
                left join chart_status s using (turnout_id, section_id, band, source)
                left join since using (turnout_id, section_id, band, source)
                where c.state = 'learning'
            ),
            learners as (
                select *, least(has_campaigns / {BASELINE.baseline_campaigns}, has_days / {BASELINE.baseline_days}, 1)
                    + 1e-6 * least(has_campaigns, 1000) as progress
                from known
            )
            select count(*) filter (reason <> 'after_event') as n, count(*) filter (reason = 'after_event') as n_again,
                coalesce(max_by(has_campaigns, progress) filter (reason <> 'after_event'), 0) as n_campaigns,
                coalesce(max_by(has_days, progress) filter (reason <> 'after_event'), 0) as n_days
            from learners"""
        return self._fetch(sql)[0]

    def worklist(self) -> list[dict[str, Any]]:
        """Tomorrow's worklist; empty before the first trend."""
        return self._fetch("select * from worklist(:today) order by rank") if self.has("worklist") else []

    def listed_states(self) -> list[dict[str, Any]]:
        """States in the whole worklist by turnout."""
        sql = f"select distinct turnout_id, state from {whole_list(':today')}"
        return self._fetch(sql) if self.has("worklist") else []

    def scores(self) -> list[dict[str, Any]]:
        """Long-term score of each turnout with a drift of a resonance, and the chart that it comes from."""
        return self._fetch(SCORES) if self.has("chart_states") else []

    def has(self, table: str) -> bool:
        """Whether the registry has ``table``; those of the trend exist after its first run.

        Parameters
        ----------
        table : str
            Key of ``ROWS``, or table of the registry.

        Returns
        -------
        bool
            Whether the query of this kind can run.
        """
        return table not in TREND_VIEWS or table in self.views

    def rows_of(self, turnout_ids: Collection[str]) -> dict[str, Mapping[str, list[dict[str, Any]]]]:
        """Rows of the given turnouts from all queries.

        Parameters
        ----------
        turnout_ids : collection of str
            Ids of turnouts.

        Returns
        -------
        dict
            Rows by kind and turnout id: {table: {turnout_id: [row, ...]}}.
        """
        chosen = {"turnouts": list(turnout_ids)}
        self._read_history()
        tables = [table for table in ROWS if self.has(table)]
        rows = {table: _by_turnout(self._fetch(ROWS[table], chosen)) for table in tables if table != "receptances"}
        rows |= train_rows(self._fetch, turnout_ids, self.has("charts"))
        return rows | {"receptances": _by_turnout(self._arrays(ROWS["receptances"], chosen))}

    def _read_history(self) -> None:
        """Read the scatter between campaigns into a temporary table, once."""
        if not self._has_history:
            sql = f"create or replace temp table {HISTORY} as select * from mode_scatter"
            self.connection.execute(sql)
            self._has_history = True

    def _arrays(self, sql: str, parameters: Mapping[str, Any]) -> list[dict[str, Any]]:
        """Rows with lists as numpy arrays, which is many times faster than Python lists, and needs no pandas."""
        columns = self.connection.execute(sql, parameters).fetchnumpy()
        values = [column.tolist() for column in columns.values()]  # None where masked
        return [dict(zip(columns, row)) for row in zip(*values)]

    def _fetch(self, sql: str, parameters: Mapping[str, Any] | None = None) -> list[dict[str, Any]]:
        cursor = self.connection.execute(sql.replace(":today", self.day), parameters or {})
        names = [d[0] for d in cursor.description]
        return [dict(zip(names, row)) for row in cursor.fetchall()]


def _by_turnout(rows: Iterable[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    grouped = defaultdict(list)
    for row in rows:
        grouped[row["turnout_id"]].append(row)
    return grouped
