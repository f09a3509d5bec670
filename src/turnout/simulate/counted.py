"""Terms that count a track's supports, on a track whose supports are counted from elsewhere."""

from dataclasses import fields, replace

COUNTED = ("sleeper", "support", "first", "last")  # fields of terms that count supports from the track's start


def moved(term, count):
    """The term at the same places of a track that has ``count`` supports more in front."""
    return replace(term, **{name: getattr(term, name) + count for name in _counted(term)})


def on_stretch(terms, keep):
    """The terms as a stretch counts its supports, ``keep`` (n_support,) of the whole track; none of what lies outside.

    Of a run of supports that lies partly outside, the part inside is left.
    """
    first, last = int(keep.argmax()), len(keep) - 1 - int(keep[::-1].argmax())
    found = []
    for term in terms:
        names = _counted(term)
        run = {"first", "last"} <= names
        start, end = (term.first, term.last) if run else (first, last)
        own = [getattr(term, name) for name in names - {"first", "last"}]
        if start > last or end < first or not all(first <= value <= last for value in own):
            continue
        if run:
            term = replace(term, first=max(start, first), last=min(end, last))
        found.append(moved(term, -first))
    return tuple(found)


def _counted(term):
    return {f.name for f in fields(term) if f.name in COUNTED}
