"""Notes on the recordings of visits, those with the same words in one line."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from turnout.stages.mismatch_inputs import Note


def notes_in_words(visit: str, notes: Iterable[Note]) -> list[tuple[str, str, bool]]:
    """Notes of a visit as they are stored.

    Parameters
    ----------
    visit : str
    notes : iterable of Note

    Returns
    -------
    list of (str, str, bool)
        Visit, words, and whether they concern one passage. The same words of two passages are two entries.
    """
    return [(visit, note.text, note.passage is not None) for note in notes]


def texts_of_notes(notes: Iterable[Note]) -> list[str]:
    """Notes of one visit as texts, one for all passages with the same words.

    Parameters
    ----------
    notes : iterable of Note

    Returns
    -------
    list of str
        In the order of their first notes.

    Examples
    --------
    >>> from turnout.stages.mismatch_inputs import Note
    >>> texts_of_notes([Note("no axle found", "a.h5"), Note("no track file"), Note("no axle found", "b.h5")])
    ['passages a.h5, b.h5: no axle found', 'no track file']
    """
    passages: dict[tuple[bool, str], list[str]] = {}
    for note in notes:
        passages.setdefault((note.passage is None, note.text), []).append(note.passage or "")
    return [
        text if whole_visit else f"passage{'s' * (len(names) > 1)} {', '.join(names)}: {text}"
        for (whole_visit, text), names in passages.items()
    ]


def summary_of_notes(notes: Iterable[tuple[str, str, bool]]) -> list[str]:
    """One line for all notes with the same words, the most frequent first.

    Parameters
    ----------
    notes : iterable of (str, str, bool)
        As ``notes_in_words``.

    Returns
    -------
    list of str

    Examples
    --------
    >>> passages = [("2026-01-05", "no axle found", True), ("2026-02-03", "no axle found", True)]
    >>> summary_of_notes([*passages, ("2026-01-05", "x", False)])
    ['2 passages of 2 visits: no axle found', 'visit 2026-01-05: x']
    """
    members: dict[tuple[bool, str], list[str]] = {}
    for visit, words, of_passage in notes:
        members.setdefault((of_passage, words), []).append(visit)
    lines = []
    for (of_passage, words), of in sorted(members.items(), key=lambda item: (-len(item[1]), item[0])):
        n_visit = len(set(of))
        where = f"visit {of[0]}" if n_visit == 1 else f"{n_visit} visits"
        passages = f"{len(of)} passage{'s' * (len(of) > 1)} of " if of_passage else ""
        lines.append(f"{passages}{where}: {words}")
    return lines
