"""Tables 1 to 4 of the paper for one turnout and campaign, from the registry, as text, CSV or LaTeX."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.records.modal import value_with_error

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    import duckdb

ENTRIES = ("a11", "a12", "a21", "a22", "c1", "c2")
PAPER_TRAIN, PAPER_SPEED = "IC3", 160.0  # trains of Table 4 [km/h]
SPEED_TOLERANCE = 5.0  # km/h
LATEX_ESCAPES = str.maketrans({"_": r"\_", "%": r"\%", "&": r"\&", "#": r"\#"})


@dataclass(frozen=True)
class Quantity:
    """A ``value`` with its ``error`` and its ``unit``; all None where it was not measured."""

    value: float | None
    error: float | None = None

    def __str__(self) -> str:
        return "-" if self.value is None else value_with_error(self.value, self.error)


@dataclass(frozen=True)
class PaperTable:
    """``title``, names of the ``columns``, and ``rows`` of labels (str), quantities and counts (int)."""

    number: int
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str | Quantity | int | None, ...], ...]


def paper_tables(
    connection: duckdb.DuckDBPyConnection,
    turnout: str,
    campaign: str,
    train_type: str = PAPER_TRAIN,
    speed: float = PAPER_SPEED,
) -> tuple[PaperTable, ...]:
    """The four tables of one campaign.

    Parameters
    ----------
    connection : duckdb.DuckDBPyConnection
        The registry.
    turnout : str
        Turnout.
    campaign : str
        Id of the campaign.
    train_type : str
        Trains of Table 4.
    speed : float
        Their speed on the main track. [km/h]

    Returns
    -------
    tuple of PaperTable
        Tables 1 and 2 (matrices of the ballast and the railpad resonance), 3 (modes) and 4 (fits).
    """
    return (
        _matrices(connection, campaign, 1, "ballast"),
        _matrices(connection, campaign, 2, "railpad"),
        _modes(connection, campaign),
        _fits(connection, turnout, campaign, train_type, speed),
    )


def _matrices(connection: duckdb.DuckDBPyConnection, campaign: str, number: int, band: str) -> PaperTable:
    columns = ", ".join(f"{e}, {e}_se" for e in ENTRIES)
    query = (
        f"select section_id, {columns}, n_impacts from section_matrices where campaign_id = ? and band = ? order by 1"
    )
    rows = [
        (_label(row[0]), *(Quantity(row[1 + 2 * k], row[2 + 2 * k]) for k in range(len(ENTRIES))), row[-1])
        for row in connection.execute(query, [campaign, band]).fetchall()
    ]
    title = f"Models of the {band} resonance, ± standard error over n impacts"
    return PaperTable(number, title, ("section", *ENTRIES, "n"), tuple(rows))


def _modes(connection: duckdb.DuckDBPyConnection, campaign: str) -> PaperTable:
    query = """
        select m.section_id, m.band, m.frequency_hz, m.frequency_se_hz, m.damping_ratio, m.damping_se, m.stiffness_mn_m,
            m.stiffness_low_mn_m, m.stiffness_high_mn_m, m.n_impacts, k.sampling_rate_hz
        from modes_current m join models_current k on m.model_id = k.model_id
        where k.campaign_id = ? and m.source = 'hammer' order by m.section_id, m.band
    """
    rows = []
    for section, band, frequency, f_se, damping, d_se, stiffness, low, high, n, rate in connection.execute(
        query, [campaign]
    ).fetchall():
        s = 2.0 * np.pi * frequency * (-damping + 1j * np.sqrt(1.0 - damping**2))
        pole = np.exp(s / rate)
        error = None if stiffness is None or high is None else 0.5 * (high - low)
        rows.append(
            (
                _label(section), band, f"{pole.real:.4f} ± {pole.imag:.4f}i", Quantity(frequency, f_se),
                Quantity(damping, d_se), Quantity(stiffness, error), n,
            )
        )  # fmt: skip
    columns = "section", "band", "pole", "frequency [Hz]", "damping ratio", "stiffness [MN/m]", "n"
    title = "Modes, ± standard error over n impacts (stiffness: half the 95 % interval)"
    return PaperTable(3, title, columns, tuple(rows))


def _fits(
    connection: duckdb.DuckDBPyConnection, turnout: str, campaign: str, train_type: str, speed: float
) -> PaperTable:
    is_main = "f.track = 'main' and abs(f.speed_kmh - $speed) <= $tolerance"
    is_diverging = "f.track = 'diverging'"
    aggregates = ", ".join(
        f"{function}(f.{column}) filter ({group})"
        for group in (is_main, is_diverging)
        for function, column in (
            ("avg", "fit_pct"), ("stddev_samp", "fit_pct"), ("count", "fit_pct"), ("avg", "fit_null_pct"),
            ("avg", "forecast_pct"), ("avg", "forecast_null_pct"),
        )
    )  # fmt: skip
    query = f"""
        select k.section_id, k.hammer_fit_pct, k.n_impacts_used, k.validation_fit_pct, k.n_validation, {aggregates}
        from models_current k
            left join section_scores f on f.section_id = k.section_id and f.turnout_id = $turnout
                and f.train_type = $train_type
        where k.campaign_id = $campaign and k.status <> 'rejected' group by all order by 1
    """
    parameters = {
        "turnout": turnout, "campaign": campaign, "train_type": train_type, "speed": speed,
        "tolerance": SPEED_TOLERANCE,
    }  # fmt: skip
    rows = []
    for section, fit, n, second, n_second, *trains in connection.execute(query, parameters).fetchall():
        cells: list[Quantity | int] = []
        for mean, spread, n_train, *others in (trains[:6], trains[6:]):
            cells += [Quantity(mean, spread), n_train, *(cell for v in others for cell in (Quantity(v), n_train))]
        rows.append((_label(section), Quantity(fit), n, Quantity(second), n_second or 0, *cells))
    scores = "{0}", "random models, {0}", "forecast, {0}", "forecast of random models, {0}"
    names = [name.format(track) for track in ("main track", "diverging track") for name in scores]
    columns = ("section", "held-out impacts", "n", "second response", "n", *(c for name in names for c in (name, "n")))
    title = (
        f"Fit [%]; {train_type} trains within {SPEED_TOLERANCE:g} km/h of {speed:g} km/h on the main track, "
        "at any speed on the diverging track: mean ± standard deviation over n trains; random models: mean of 95 % "
        "quantiles"
    )
    return PaperTable(4, title, columns, tuple(rows))


def class_rows(connection: duckdb.DuckDBPyConnection, turnout: str) -> list[dict[str, Any]]:
    """The bars of the paper: fit by train type, speed and axle load of each section.

    Parameters
    ----------
    connection : duckdb.DuckDBPyConnection
        The registry.
    turnout : str
        Turnout.

    Returns
    -------
    list of dict
        Rows of the view ``fit_adjusted``, score "fit".
    """
    cursor = connection.execute(
        "select * from fit_adjusted where turnout_id = ? and score = 'fit' "
        "order by section_id, factor, class_from, class",
        [turnout],
    )
    return [dict(zip((d[0] for d in cursor.description), row)) for row in cursor.fetchall()]


def class_table(rows: Sequence[Mapping[str, Any]]) -> PaperTable:
    """The numbers behind the bars, beside what random models reach.

    Parameters
    ----------
    rows : sequence of mapping
        From ``class_rows``.

    Returns
    -------
    PaperTable
        Table 5, which the paper shows as bars alone.
    """
    cells = [
        (
            _label(r["section_id"]), r["factor"], r["class"], Quantity(r["score_pct"], r["score_sd_pct"]),
            r["n_passages"], Quantity(r["null_pct"]), r["n_passages"],
            Quantity(r["adjusted_pct"], r["adjusted_se_pct"]), r["n_passages"],
        )
        for r in rows
    ]  # fmt: skip
    columns = "section", "factor", "class", "fit", "n", "random models", "n", "other factors held fixed", "n"
    title = (
        "Fit [%] by class of trains: mean ± standard deviation over n passages; random models: mean of 95 % quantiles; "
        "other factors held fixed: ± standard error"
    )
    return PaperTable(5, title, columns, tuple(cells))


def _label(section_id: str) -> str:
    return section_id.split("/", 1)[1]


def render(tables: Sequence[PaperTable], form: str) -> str:
    """The tables in one text.

    Parameters
    ----------
    tables : sequence of PaperTable
        Tables to print.
    form : "text", "csv" or "latex"
        CSV has one row per value: table, section, band (Table 5: class), quantity, value, error, n.

    Returns
    -------
    str
        Ends with a line break.

    Raises
    ------
    ValueError
        For another form.
    """
    forms = {"text": _text, "latex": _latex, "csv": _csv}
    if form not in forms:
        raise ValueError(f"no form {form!r}; there are {sorted(forms)}")
    return forms[form](tables)


def _text(tables: Sequence[PaperTable]) -> str:
    parts = []
    for table in tables:
        lines = [table.columns, *([_cell(cell) for cell in row] for row in table.rows)]
        widths = [max(len(line[k]) for line in lines) for k in range(len(table.columns))]
        text = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip() for line in lines]
        empty = [] if table.rows else ["(no section)"]
        parts.append("\n".join([f"Table {table.number}: {table.title}", *text, *empty, ""]))
    return "\n".join(parts)


def _cell(cell: str | Quantity | int | None) -> str:
    return "" if cell is None else str(cell)


def _latex(tables: Sequence[PaperTable]) -> str:
    parts = []
    for table in tables:
        lines = [table.columns, *([_cell(cell) for cell in row] for row in table.rows)]
        rows = [" & ".join(c.translate(LATEX_ESCAPES).replace("±", r"$\pm$") for c in line) + r" \\" for line in lines]
        caption = f"{table.title}.".translate(LATEX_ESCAPES).replace("±", r"$\pm$")
        head = [
            r"\begin{table}",
            rf"\caption{{{caption}}}",
            rf"\begin{{tabular}}{{{'l' * len(table.columns)}}}",
            r"\hline",
        ]
        tail = [r"\hline", r"\end{tabular}", r"\end{table}", ""]
        parts.append("\n".join([*head, rows[0], r"\hline", *rows[1:], *tail]))
    return "\n".join(parts)


def _csv(tables: Sequence[PaperTable]) -> str:
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["table", "section", "band", "quantity", "value", "error", "n"])
    bands = {1: "ballast", 2: "railpad"}
    for table in tables:
        for row in table.rows:
            part = {"band": 1, "factor": 2}.get(table.columns[1])
            band = bands.get(table.number, "" if part is None else row[part])
            for k, (name, cell) in enumerate(zip(table.columns, row, strict=True)):
                if isinstance(cell, Quantity) and cell.value is not None:
                    n = row[table.columns.index("n", k)]
                    error = "" if cell.error is None else f"{cell.error:.6g}"
                    writer.writerow([table.number, row[0], band, name, f"{cell.value:.8g}", error, n])
    return stream.getvalue()
