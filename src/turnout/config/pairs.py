"""Settings that are two ends: the low one lies below the high one, and neighbouring ranges do not overlap."""

from collections.abc import Iterator

from turnout.config.document import Branch
from turnout.config.settings_keys import settings_keys
from turnout.errors import ConfigError

ENDS = (("_low", "_high"), ("_minimum", "_maximum"))
BESIDE = (("identify", "ballast_high", "railpad_low"),)  # one range ends before the next begins, or where it does


def ends_of_ranges() -> Iterator[tuple[str, str, str]]:
    """(part, name of the low end, name of the high end) of every range of the settings.

    >>> ("identify", "ballast_low", "ballast_high") in list(ends_of_ranges())
    True
    """
    for part, group in settings_keys().items():
        for name in group.spec:
            for low, high in ENDS:
                if name.endswith(low) and (other := name.removesuffix(low) + high) in group.spec:
                    yield part, name, other


def check_ranges(settings: Branch) -> Iterator[ConfigError]:
    """An error for every range of ``settings`` whose low end is not below its high end; keys are sound."""
    for part, low, high in (*ends_of_ranges(), *BESIDE):
        written = settings.get(part, {})
        leaves = [written[name] for name in (low, high) if name in written]
        values = [
            written[name].value if name in written else settings_keys()[part].spec[name].default for name in (low, high)
        ]
        meet = (part, low, high) in BESIDE and values[0] == values[1]
        if leaves and not (values[0] < values[1] or meet):
            beside = f" in {leaves[1].place.path}, {leaves[1].place}" if len(leaves) > 1 else ""
            found = f"{part}.{low} is {values[0]}, and {high} is {values[1]}{beside}"
            yield leaves[0].place.error(found, f"Write a {low} below {high}")
    bands = settings.get("identify", {}).get("extra_bands")
    if bands and not _rising_pairs(bands.value):
        yield bands.place.error(f"extra_bands is {list(bands.value)}", "Write pairs [low, high, low, high, ...]")


def _rising_pairs(edges: tuple[float, ...]) -> bool:
    return len(edges) % 2 == 0 and all(low < high for low, high in zip(edges[::2], edges[1::2]))
