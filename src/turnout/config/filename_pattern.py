"""File-name patterns such as ``hammer/{campaign}/{section}_{test}.{ext}``, which find and name raw files."""

import re
import unicodedata
from functools import lru_cache

from turnout.config.schema import suggestion

FIELDS = {
    "hammer": {"campaign": r"\d{4}-\d{2}-\d{2}", "test": r"[A-Za-z0-9]+", "ext": r"[A-Za-z0-9]+"},
    "passages": {"time": r"\d{8}T\d{6}Z", "ext": r"[A-Za-z0-9]+"},
}
REQUIRED_FIELDS = {"hammer": ("campaign", "section"), "passages": ("time",)}


@lru_cache(maxsize=256)
def compile_pattern(pattern: str, branch: str, sections: tuple[str, ...] = (), free_field: str = "") -> re.Pattern:
    """Regular expression of a pattern of file names: one named group per field; ``*`` is anything but a slash.

    Parameters
    ----------
    pattern : str
        Pattern below the raw folder of a turnout.
    branch : str
        "hammer" or "passages".
    sections : tuple of str
        Labels that ``{section}`` stands for; none: any text.
    free_field : str
        Field that may be any text without a slash.

    Returns
    -------
    Pattern
        The compiled expression.

    Raises
    ------
    ValueError
        For an unknown or missing field; the message has the remedy.

    Examples
    --------
    >>> match = compile_pattern("hammer/{campaign}/{section}_{test}.{ext}", "hammer", ("A7", "AS"))
    >>> match.fullmatch("hammer/2024-05-13/A7_2.uff").groupdict()
    {'campaign': '2024-05-13', 'section': 'A7', 'test': '2', 'ext': 'uff'}
    """
    if "\\" in pattern or pattern.startswith("/") or {"", ".", ".."} & set(pattern.split("/")):
        raise ValueError("it is a path below the raw folder of the turnout, with '/' between folders, without '..'")
    fields = dict(FIELDS[branch])
    if branch == "hammer":
        fields["section"] = "|".join(re.escape(s) for s in sorted(sections, key=len, reverse=True)) or "[^/]+"
    if free_field in fields:
        fields[free_field] = "[^/]+"
    expression, names = "", set()
    for token in re.split(r"(\{\w*\}|\*)", pattern):
        if token == "*":
            expression += "[^/]*"
        elif token.startswith("{"):
            name = token[1:-1]
            if name not in fields:
                raise ValueError(f"unknown field {token} in the pattern. {suggestion(name, fields)}")
            expression += f"(?P={name})" if name in names else f"(?P<{name}>{fields[name]})"
            names.add(name)
        elif brace := re.search(r"[{}]", token):
            raise ValueError(f"a {brace[0]!r} without its pair, in {token!r}")
        else:
            expression += re.escape(token)
    if missing := [f"{{{name}}}" for name in REQUIRED_FIELDS[branch] if name not in names]:
        raise ValueError(f"the pattern lacks {', '.join(missing)}")
    return re.compile(unicodedata.normalize("NFC", expression))


FIELD_PROBLEMS = {
    "campaign": "no day as YYYY-MM-DD",
    "section": "no section of the layout",
    "time": "no start as YYYYMMDDTHHMMSSZ",
    "test": "not of letters and digits alone",
    "ext": "not of letters and digits alone",
}


def wrong_field(name: str, pattern: str, branch: str, sections: tuple[str, ...] = ()) -> tuple[str, str]:
    """The part by which alone a name misses a pattern.

    Parameters
    ----------
    name : str
        Path below the raw folder of a turnout.
    pattern : str
        Pattern of the layout.
    branch : str
        "hammer" or "passages".
    sections : tuple of str
        Labels that ``{section}`` stands for.

    Returns
    -------
    tuple of (str, str)
        Its field and what is wrong, in words; "" and "" if it misses the pattern by more than one field.

    Examples
    --------
    >>> pattern = "hammer/{campaign}/{section}_{test}.{ext}"
    >>> wrong_field("hammer/13-05-2026/A7_2.uff", pattern, "hammer", ("A7",))
    ('campaign', "'13-05-2026' is no day as YYYY-MM-DD")
    >>> wrong_field("hammer/2026-05-13/a7_2.uff", pattern, "hammer", ("A7",))
    ('section', "'a7' is no section of the layout, but 'A7' is")
    """
    for field, problem in FIELD_PROBLEMS.items():
        if f"{{{field}}}" in pattern:
            match = compile_pattern(pattern, branch, sections, field).fullmatch(unicodedata.normalize("NFC", name))
            if match:
                text = match[field]
                other_case = [s for s in sections if field == "section" and s.casefold() == text.casefold()]
                return field, f"{text!r} is {problem}" + (f", but {other_case[0]!r} is" if other_case else "")
    return "", ""
