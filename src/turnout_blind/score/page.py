"""Write the measured part of a page, between two marks, from a scored set. The other text stays unchanged."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from turnout_blind.score.case_reports import case_texts
from turnout_blind.score.plots import draw_reliability, draw_severity
from turnout_blind.score.report import read_oracle, report_text, score_set
from turnout_blind.seal import BlindError
from turnout_blind.whole_file import write_whole

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"
PICTURE_KEY = (
    '*Red: a wrong name was among those given, also beside a right one. ½: the right name was in an "a or b".*'
)


def write_page(
    path: str | Path,
    out: str | Path,
    extra_names: Mapping[str, Sequence[str]] | None = None,
    effects: Iterable[str | Path] = (),
    cases: Sequence[str] | None = None,
) -> Path:
    """Write report, pictures and case reports of a set between the marks of a page.

    Pictures are written beside the page under its name.

    Parameters
    ----------
    path : str or Path
        File of the page.
    out : str or Path
        Folder of the set.
    extra_names : mapping or None
        Right names of added effects by kind.
    effects : iterable of str or Path
        Folders with further effects.
    cases : sequence of str or None
        Cases that are reported; None: three are chosen.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    BlindError
        If the page lacks the marks.
    """
    path = Path(path)
    text = path.read_text(encoding="utf-8")
    if text.count(BEGIN) != 1 or text.count(END) != 1:
        raise BlindError(path, "marks", f"{BEGIN} and {END} are not there once each", "Put them where figures belong")
    results, _ = score_set(out, extra_names)
    severity, reliability = f"{path.stem}_severity.svg", f"{path.stem}_reliability.svg"
    draw_severity(results, path.with_name(severity))
    draw_reliability(results, path.with_name(reliability))
    stories = case_texts(out, path, cases, extra_names, read_oracle(out), effects)
    measured = "\n\n".join(
        [
            report_text([out], extra_names).strip(),
            f"![Answers by kind and size of the concealed effect]({severity})", PICTURE_KEY,
            f"![Stated probability and share right]({reliability})", stories,
        ]
    )  # fmt: skip
    head, tail = text.split(BEGIN)
    write_whole(path, f"{head}{BEGIN}\n\n{measured}\n\n{END}{tail.split(END)[1]}".encode())
    return path
