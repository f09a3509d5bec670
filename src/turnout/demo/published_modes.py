"""Compare the published modes of recordings by others with the modes identified here."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from turnout.content import sha256_of
from turnout.demo.others import SDYPY_FILE, SDYPY_SHA256
from turnout.errors import TurnoutError
from turnout.modal.frf import modes_of_frf
from turnout.readers.uff import read_frf
from turnout.readers.uff_datasets import read_datasets

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from turnout.modal.frf import FrfMode

# (frequency [Hz], damping [%]) of the seven modes as its makers publish them.
SDYPY_BEAM = (
    (177.0, 0.86), (477.4, 0.20), (933.1, 0.15), (1535.5, 0.20), (2286.9, 0.28), (3162.4, 0.18), (4181.2, 0.15),
)  # fmt: skip
# peaks of the three curves in the file; no table of its modes was published
UFF_BEAM = tuple((f, None) for f in (52.6, 144.6, 283.1, 468.3, 698.5, 973.0, 1293.0))
LOWEST_FLEXURAL = 40.0  # Hz: below it a beam moves as a whole on its supports, which no table lists
FUNCTIONS = {0: "general functions", 1: "time responses", 2: "auto-spectra", 4: "frequency responses", 6: "coherences"}
HITS = {0: "overloaded on purpose", 1: "good", 2: "double impact", 3: "good", 4: "good"}


PublishedMode: TypeAlias = tuple[float, float | None]  # frequency [Hz], damping [%]
ModeRow: TypeAlias = "tuple[float | None, float | None, FrfMode | None]"


@dataclass(frozen=True)
class Beam:
    """A beam: ``frequency`` (n_line,) [Hz], ``responses`` (n_frf, n_line) complex.

    ``rows`` are (published frequency [Hz], published damping [%], identified mode), None where one is missing.
    """

    name: str
    origin: str
    frequency: np.ndarray
    responses: np.ndarray
    highest: float
    rows: tuple[ModeRow, ...]


def beam_modes(raw: Path | str) -> Iterator[Beam]:
    """Modes of the two beams whose frequency responses lie below ``raw``, published and identified.

    Parameters
    ----------
    raw : path
        Raw root with the files of ``turnout.demo.others``.

    Returns
    -------
    iterator of Beam
        One per file.

    Raises
    ------
    TurnoutError
        If a file is not the published one.
    """
    path = Path(raw) / SDYPY_FILE
    if sha256_of(path) != SDYPY_SHA256:
        # it is a pickle, and a pickle of unknown origin can run any code
        raise TurnoutError(f"{path} is not the published file. Delete it and run again")
    frequency, responses = np.load(path, allow_pickle=True)
    frequency, responses = np.asarray(frequency, float), np.asarray(responses, complex).reshape(-1, len(frequency))
    yield _beam("beam of sdypy-EMA 0.27.3", "published by its makers", frequency, responses, SDYPY_BEAM, 4500.0)
    uff = read_frf("frf/beam.uff", raw)
    yield _beam("beam.uff of pyuff 2.4.2", "peaks read off its curves", uff.frequency, uff.frf, UFF_BEAM, 1400.0)


def _beam(
    name: str,
    origin: str,
    frequency: np.ndarray,
    responses: np.ndarray,
    published: Iterable[PublishedMode],
    highest: float,
) -> Beam:
    rows = _rows(frequency, responses, published, highest)
    return Beam(name, origin, frequency, np.atleast_2d(responses), highest, tuple(rows))


def _rows(
    frequency: np.ndarray, responses: np.ndarray, published: Iterable[PublishedMode], highest: float
) -> list[ModeRow]:
    """Every published mode with the nearest identified mode, then the identified modes that are not published."""
    modes = list(modes_of_frf(frequency, responses, LOWEST_FLEXURAL, highest).modes)
    rows = []
    for f, damping in published:
        nearest = min(modes, key=lambda m: abs(m.frequency.mean - f), default=None)
        if nearest is not None and abs(nearest.frequency.mean - f) > 0.02 * f:
            nearest = None
        rows.append((f, damping, nearest))
        if nearest in modes:
            modes.remove(nearest)
    return rows + [(None, None, mode) for mode in modes]


def uff_contents(path: Path | str) -> str:
    """Content of a vendor's UFF file in words.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    str
        Data sets by type, their lengths, damage.
    """
    sets = [s for s in read_datasets(Path(path).read_bytes()) if s.dataset_type in ("58", "58b")]
    damaged = [s.damage for s in sets if s.damage]
    set_names = [
        FUNCTIONS.get(s.func_type, f"functions of type {s.func_type}") + f" ({s.dataset_type})"
        for s in sets
        if not s.damage
    ]
    counts = Counter(set_names)
    lengths = sorted({len(s.data) for s in sets if not s.damage})
    contents = ", ".join(f"{n} {name}" for name, n in counts.items())
    span = f"; {' to '.join(dict.fromkeys(str(n) for n in (lengths[0], lengths[-1])))} values" if lengths else ""
    return f"{contents or 'no intact set'}{span}" + (f"; damaged: {damaged}" if damaged else "")
