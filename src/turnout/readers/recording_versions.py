"""Groups of a file that are versions of one recording, as "raw" and "filtered", and no records of their own."""

import re
from collections.abc import Sequence

from turnout.readers.rate_units import words_of
from turnout.readers.source import Source

# What was done with a recording, without case and accents, in several languages.
VERSION_WORD = re.compile(
    r"(?:un)?(?:filter(?:ed|t)?|scaled|calibrated|corrected|process(?:ed)?|detrended|resampled|decimated|integrated"
    r"|smoothed|windowed|averaged)|raw|original|backup|copy|roh(?:daten)?|(?:un)?gefiltert|kalibriert|skaliert"
    r"|verarbeitet|kopie|brut(?:es)?|filtre(?:es?)?|copie|filtreret|kopi"
)
NEUTRAL_WORDS = frozenset("data daten signal signals signale measured measurement messung samples values".split())


def check_versions(names: Sequence[str], source: Source) -> None:
    """Check that no two groups with the same channels are versions of one recording.

    Each impact would count twice, once as it was measured and once as a program changed it.

    Parameters
    ----------
    names : sequence of str
        Names of groups that have the same channels.
    source : Source
        The raw file.

    Raises
    ------
    ReadError
        If two names differ only in words for such versions.
    """
    groups: dict[tuple[tuple[str, ...], tuple[str, ...]], list[str]] = {}
    for name in names:
        words = tuple(w for w in words_of(name) if not VERSION_WORD.fullmatch(w) and w not in NEUTRAL_WORDS)
        groups.setdefault((words, tuple(re.findall(r"\d+", name))), []).append(name)
    for versions in groups.values():
        if len(versions) > 1 and any(VERSION_WORD.fullmatch(w) for name in versions for w in words_of(name)):
            listed = " and ".join(map(repr, versions[:3]))
            problem = f"{listed} have the same channels, and their names say that they are versions of one recording"
            raise source.error("the groups", problem, "Export one of them to a file of its own")
