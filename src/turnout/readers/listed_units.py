"""A list of units beside channels that are variables of their own: which unit is whose."""


class Alphabetical(dict):
    """Variables of a file that keeps them by the alphabet: their order says nothing."""


def listed_units(names, units, labels, ordered):
    """Unit of each of ``names``: by the list of ``labels`` beside the units, else by order; "" where none is said.

    None where the units differ and the names are not ``ordered``: then nothing says which of them is whose.

    >>> listed_units(["rail", "sleeper"], ["g", "m/s²"], ["Sleeper", "rail"], ordered=False)
    ['m/s²', 'g']
    >>> listed_units(["rail", "sleeper"], ["g", "m/s²"], [], ordered=True)
    ['g', 'm/s²']
    >>> listed_units(["rail", "sleeper"], ["g", "m/s²"], [], ordered=False)
    """
    wanted, labels = [name.casefold() for name in names], [label.casefold() for label in labels]
    if len(labels) == len(set(labels)) == len(units) and set(wanted) <= set(labels):
        return [units[labels.index(name)] for name in wanted]
    if len(units) == 1:
        return units * len(names)
    if len(units) != len(names):
        return [""] * len(names)
    return units if ordered or len(set(units)) == 1 else None
