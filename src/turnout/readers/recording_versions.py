"""Groups of a file that are no records of their own: versions of one recording, and channels."""

import re
from collections.abc import Iterable, Sequence

from turnout.readers.channel_descriptions import quantity_of_sensor
from turnout.readers.rate_units import words_of
from turnout.readers.source import Source

# What was done with a recording, without case and accents, in several languages.
VERSION_WORD = re.compile(
    r"(?:un)?(?:filter(?:ed|t)?|scaled|calibrated|corrected|process(?:ed)?|detrended|resampled|decimated|integrated"
    r"|smoothed|windowed|averaged)|raw|original|backup|copy|roh(?:daten)?|(?:un)?gefiltert|kalibriert|skaliert"
    r"|verarbeitet|kopie|brut(?:es)?|filtre(?:es?)?|copie|filtreret|kopi"
)
NEUTRAL_WORDS = frozenset("data daten signal signals signale measured measurement messung samples values".split())


def check_groups(names: Sequence[str], channels: Iterable[str], source: Source) -> None:
    """Check that groups with the same channels are the records of a file.

    Of two versions of one recording each impact would count twice, once as it was measured and once as a program
    changed it. Where each group holds one channel of all records, two impacts would be force and response.

    Parameters
    ----------
    names : sequence of str
        Names of groups that have the same channels.
    channels : iterable of str
        Names of these channels.
    source : Source
        The raw file.

    Raises
    ------
    ReadError
        If two names differ only in words for versions, if one of them is that of a calibration or of noise, or if the
        groups have names of different sensors and the channels have not.
    """
    channels = list(channels)
    are_of_sensors = len(set(map(quantity_of_sensor, names))) > 1
    if are_of_sensors and len(channels) > 1 and not any(map(quantity_of_sensor, channels)):
        groups_listed, channels_listed = (" and ".join(map(repr, texts[:3])) for texts in (names, channels))
        problem = f"{groups_listed} are named as channels, and each holds {channels_listed}"
        remedy = "Export a group for each record, with its channels by their names"
        raise source.error("the groups", problem, remedy, reason="channel_missing")
    groups: dict[tuple[tuple[str, ...], tuple[str, ...]], list[str]] = {}
    for name in names:
        words = tuple(w for w in words_of(name) if not VERSION_WORD.fullmatch(w) and w not in NEUTRAL_WORDS)
        groups.setdefault((words, tuple(re.findall(r"\d+", name))), []).append(name)
    for versions in groups.values():
        if len(versions) > 1 and any(VERSION_WORD.fullmatch(w) for name in versions for w in words_of(name)):
            listed = " and ".join(map(repr, versions[:3]))
            problem = f"{listed} have the same channels, and their names say that they are versions of one recording"
            raise source.error("the groups", problem, "Export one of them to a file of its own")
    beside = [name for name in names if any(BESIDE_TEST.fullmatch(word) for word in words_of(name))]
    if beside and len(beside) < len(names):
        measured = next(name for name in names if name not in beside)
        problem = f"{beside[0]!r} has the same channels as {measured!r}, and its name is that of no part of a test"
        raise source.error("the groups", problem, "Export the records of the test to a file of their own")


# What is recorded beside a test or a passage.
BESIDE_TEST = re.compile(
    r"ambient|noise|background|silence|idle|calib(?:ration)?|kalib(?:rierung)?|tare|zero|warm(?:up)?|dummy"
    r"|selftest|rauschen|grundrauschen|umgebung|hintergrund|ruhe|leerlauf|nullabgleich|bruit|fond|etalonnage|baggrund|st[oø]j"
)
