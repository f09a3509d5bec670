"""Tables 1 to 4 of the paper for one turnout and campaign, from the registry, as text, CSV or LaTeX."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.records.modal import value_with_error

if TYPE_CHECKING:
    from collections.abc import Sequence

    import duckdb

ENTRIES = ("a11", "a12", "a21", "a22", "c1", "c2")
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


def paper_tables(connection: duckdb.DuckDBPyConnection, turnout: str, campaign: str) -> tuple[PaperTable, ...]:
    """The four tables of one campaign.

    Parameters
    ----------
    connection : duckdb.DuckDBPyConnection
        The registry.
    turnout : str
        Turnout.
    campaign : str
        Id of the campaign.

    Returns
    -------
    tuple of PaperTable
        Tables 1 and 2 (matrices of the ballast and the railpad resonance), 3 (modes) and 4 (fits).
    """
    return (
        _matrices(connection, campaign, 1, "ballast"),
        _matrices(connection, campaign, 2, "railpad"),
        _modes(connection, campaign),
        _fits(connection, turnout, campaign),
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


def _fits(connection: duckdb.DuckDBPyConnection, turnout: str, campaign: str) -> PaperTable:
    query = """
        select k.section_id, k.hammer_fit_pct, k.n_impacts_used, k.validation_fit_pct, k.n_validation,
            avg(f.fit_pct) filter (p.track = 'main'), stddev_samp(f.fit_pct) filter (p.track = 'main'),
            count(f.fit_pct) filter (p.track = 'main'),
            avg(f.fit_pct) filter (p.track = 'diverging'), stddev_samp(f.fit_pct) filter (p.track = 'diverging'),
            count(f.fit_pct) filter (p.track = 'diverging')
        from models_current k
            left join passage_fits_current f on f.section_id = k.section_id and f.turnout_id = ?
            left join passages_current p on p.passage_id = f.passage_id
        where k.campaign_id = ? and k.status <> 'rejected' group by all order by 1
    """
    rows = []
    for section, fit, n, second, n_second, *trains in connection.execute(query, [turnout, campaign]).fetchall():
        main, diverging = (
            (Quantity(trains[k], trains[k + 1]), trains[k + 2]) if trains[k + 2] else (Quantity(None), 0)
            for k in (0, 3)
        )
        rows.append((_label(section), Quantity(fit), n, Quantity(second), n_second or 0, *main, *diverging))
    columns = (
        "section", "held-out impacts", "n", "second response", "n", "trains, main track", "n",
        "trains, diverging track", "n",
    )  # fmt: skip
    return PaperTable(4, "Fit [%]; trains: mean ± standard deviation over n trains", columns, tuple(rows))


def _label(section_id: str) -> str:
    return section_id.split("/", 1)[1]


def render(tables: Sequence[PaperTable], form: str) -> str:
    """The tables in one text.

    Parameters
    ----------
    tables : sequence of PaperTable
        Tables to print.
    form : "text", "csv" or "latex"
        CSV has one row per value: table, section, band, quantity, value, error, n.

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
            band = bands.get(table.number, row[1] if table.columns[1] == "band" else "")
            for k, (name, cell) in enumerate(zip(table.columns, row, strict=True)):
                if isinstance(cell, Quantity) and cell.value is not None:
                    n = row[table.columns.index("n", k)]
                    error = "" if cell.error is None else f"{cell.error:.6g}"
                    writer.writerow([table.number, row[0], band, name, f"{cell.value:.8g}", error, n])
    return stream.getvalue()
