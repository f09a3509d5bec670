"""Names of the configuration that become names of files and folders, on every file system."""

import re
import unicodedata

YAML_FILES = "[!.]*.yaml"  # a glob; hidden files are locks and copies of editors, or of the system
RESERVED = re.compile(r"(?:con|prn|aux|nul|(?:com|lpt)[1-9¹²³])(?:\..*)?", re.IGNORECASE)
UNUSABLE = re.compile(r'[\x00-\x1f<>:"|?*\\]')
PORTABLE = "Results could not be copied to a computer with Windows. Choose another name"


def file_key(path: str) -> str:
    """What a file system compares: two paths with one key are one file on some of them.

    Capitals, the two forms of an accented letter, and dots and blanks at the end of a name make no difference.

    Parameters
    ----------
    path : str
        A name, or a path with forward slashes.

    Returns
    -------
    str
        The key.

    Examples
    --------
    >>> file_key("Line 7/T1. ") == file_key("line 7/t1"), file_key("T1") == file_key("T2")
    (True, False)
    """
    letters = unicodedata.normalize("NFC", unicodedata.normalize("NFC", path).casefold())
    return "/".join(name.rstrip(". ") or name for name in letters.split("/"))


def name_problem(path: str) -> tuple[str, str] | None:
    """What is wrong with a name of a file or folder, and what to do about it.

    Parameters
    ----------
    path : str
        A name, or a path with forward slashes.

    Returns
    -------
    tuple of (str, str) or None
        Problem and remedy; None for a name that every file system takes.

    Examples
    --------
    >>> name_problem("line_7/aux")[0], name_problem("T1")
    ("'aux' is a name that Windows reserves", None)
    """
    for name in path.split("/"):
        if RESERVED.fullmatch(name):
            return f"{name!r} is a name that Windows reserves", PORTABLE
        if name.rstrip(". ") != name and name not in (".", ".."):
            return f"{name!r} ends with a dot or a blank, which some file systems leave out", "Remove it"
        if match := UNUSABLE.search(name):
            return f"{name!r} has the character {match[0]!r}, which Windows does not allow in names", PORTABLE
    return None
