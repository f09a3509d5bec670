"""Metadata in unknown words: what contradicts the layout and is read silently, and remarks on harmless files.

Set E and set F are files with words of different languages. A harmful file contradicts the layout; it is silent if it
is read without a message. A benign file contradicts nothing; "reported": it is rejected, "remarked": it is read with a
remark, and a person has to look.
"""

import os
from collections import Counter
from textwrap import shorten

from benchmarks.bar import Bar
from benchmarks.metadata_cases import benign, harmful, is_silent
from benchmarks.metadata_words import LANGUAGES


def bars():
    """Per set: the share of silent files, by kind, then remarks and rejections of benign files."""
    for which in os.environ.get("TURNOUT_METADATA_SETS", ",".join(LANGUAGES)).split(","):
        cases = list(harmful(which))
        silent = [case for case in cases if is_silent(case)]
        share = 100 * len(silent) / len(cases)
        yield Bar(f"set {which}, harmful entries read silently", share, 0, "%", n=f"{len(silent)} of {len(cases)}")
        of_kind = Counter(case.kind for case in cases)
        for kind, n in Counter(case.kind for case in silent).items():
            yield Bar(f"set {which}, silent, {kind}", 100 * n / of_kind[kind], None, "%", n=f"{n} of {of_kind[kind]}")
        for case in silent:
            note = f"{case.entries[0][0]}: {case.entries[0][1]} ({case.outcome} {_beginning(case.note, 80)})"
            yield Bar(f"set {which}, silent, {case.kind}, {case.format}, {case.place}", 1, None, note=note)
        cases = list(benign(which))
        for outcome in ("reported", "remarked"):
            n = sum(case.outcome == outcome for case in cases)
            yield Bar(f"set {which}, benign files {outcome}", 100 * n / len(cases), None, "%", n=f"{n} of {len(cases)}")
        for case in cases:
            if case.outcome not in ("read", "remarked"):
                yield Bar(
                    f"set {which}, benign, {case.format}: {case.outcome}",
                    1,
                    None,
                    note=_beginning(case.note, 240),
                )


def _beginning(text, width):
    return shorten(text, width, placeholder=" ...")
