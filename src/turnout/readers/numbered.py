"""Records that are told by the numbers in their names: their order, and which of them are missing."""

import re

NUMBERED = re.compile(r"^(?:record|rec|segment|impact|hit)[_ ]?(\d+)$", re.IGNORECASE)


def numbered_names(names):
    """[(number, name)] of the ``names`` that number a record.

    >>> numbered_names(["rate", "hit_02", "Record 10"])
    [(2, 'hit_02'), (10, 'Record 10')]
    """
    return [(int(m[1]), name) for name in names if (m := NUMBERED.match(name))]


def by_number(numbered, variables, source):
    """Values of the records in the order of their numbers, None for one that is missing between its neighbours.

    None is missing where gaps outnumber the records: these are numbered by a clock or a counter.
    """
    names: dict[int, list[str]] = {}
    for number, name in sorted(numbered):
        names.setdefault(number, []).append(name)
    first, last = min(names), max(names)
    whole = last - first + 1 <= 2 * len(names)
    for i, number in enumerate(range(first, last + 1) if whole else names):
        same = names.get(number, [])
        if len(same) > 1:
            found = f"{' and '.join(map(repr, same))} are both number {number}"
            yield source.error(f"record {i + 1}", found, "Number the records each by a number of its own")
        else:
            yield variables[same[0]] if same else None


def natural(name):
    """Key that sorts "record_2" before "record_10"."""
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]
