"""Write a page and a table that compare published modes of beams with those identified here."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from turnout.report.axis import Axis
from turnout.report.formatting import with_half_width
from turnout.report.site import page_environment, replace_page, shared_by_pages
from turnout.report.svg import Chart

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from turnout.modal.frf import FrfMode

NAME = "beams_of_others"
COLUMNS = (
    "beam", "published_hz", "published_damping_ratio", "frequency_hz", "frequency_low_hz", "frequency_high_hz",
    "damping_ratio", "damping_low", "damping_high", "n_responses",
)  # fmt: skip


def write_beams(beams: Sequence[Any], folder: str | Path) -> Path:
    """Write ``folder``/beams_of_others.html and .csv beside it.

    Parameters
    ----------
    beams : sequence
        Each with ``name``, ``origin``, ``frequency`` (n_line,) [Hz], ``responses`` (n_frf, n_line) complex,
        ``highest`` [Hz] and ``rows`` of (published frequency [Hz], published damping [%], identified mode or None).
    folder : str or Path
        Folder of the page and table.

    Returns
    -------
    Path
        The page.
    """
    template = page_environment().get_template("beams.html")
    entries = [
        {"name": b.name, "origin": b.origin, "drawing": beam_panel(b), "rows": [_table_row(*row) for row in b.rows]}
        for b in beams
    ]
    page = Path(folder) / f"{NAME}.html"
    replace_page(page, template.render(beams=entries, **shared_by_pages()))
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([b.name, *_csv_row(*row)] for b in beams for row in b.rows)
    replace_page(page.with_suffix(".csv"), table.getvalue())
    return page


def beam_panel(beam: Any) -> str:
    """SVG of the magnitude of every response, published modes as vertical lines, identified modes as dots.

    Parameters
    ----------
    beam : object
        Beam as in ``write_beams``.

    Returns
    -------
    str
        SVG.
    """
    inside = (beam.frequency > 0.0) & (beam.frequency <= beam.highest)
    frequency, size = beam.frequency[inside], np.abs(beam.responses[:, inside])
    valid = size[np.isfinite(size) & (size > 0.0)]
    low, high = np.quantile(valid, 0.002) / 2.0, valid.max() * 3.0
    chart = Chart(
        Axis(0.0, beam.highest, "frequency [Hz]"),
        Axis(low, high, "|response|, unit of the file", "log"),
        f"{beam.name}: {len(size)} responses; dashed: {beam.origin}, dots: found here",
        width=920,
        height=300,
    )
    for curve in size:
        chart.line(frequency, np.clip(curve, low, high), "curve failed")
    for published, _, mode in beam.rows:
        if published is not None:
            chart.vertical(published, "mode", f"{published:.0f}")
        if mode is not None:
            label = f"found: {mode.frequency.mean:.2f} Hz, n = {mode.frequency.n}"
            chart.points([mode.frequency.mean], [high / 1.8], "point", 4.0, labels=[label])
    return chart.svg()


def _csv_row(published: float | None, damping: float | None, mode: FrfMode | None) -> list:
    row = [published, None if damping is None else f"{damping / 100:.4f}"]
    if mode is None:
        return [*row, *[None] * 7]
    f, d = mode.frequency, mode.damping
    return [*row, *(f"{v:.3f}" for v in (f.mean, f.low, f.high)), *(f"{v:.6f}" for v in (d.mean, d.low, d.high)), f.n]


def _table_row(published: float | None, damping: float | None, mode: FrfMode | None) -> dict[str, Any]:
    """One row of the page's table in words; ± is the half width of the 95 % interval."""
    words = {
        "published": "not published" if published is None else f"{published:.1f}",
        "damping": "–" if damping is None else f"{damping:.2f}",
    }
    if mode is None:
        return words | {"found": "not found", "off": "–", "found_damping": "–", "n": 0}
    f, d = mode.frequency, mode.damping
    off = "–" if published is None else f"{100 * (f.mean / published - 1):+z.3f}"
    return words | {
        "found": with_half_width(f.mean, (f.high - f.low) / 2, 3),
        "off": off,
        "found_damping": with_half_width(100 * d.mean, 50 * (d.high - d.low), 3),
        "n": f.n,
    }
