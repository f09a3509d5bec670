"""Seal and verify a set: SHA-256 of every truth with its nonce, and of every file."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.errors import TurnoutError
from turnout_blind.whole_file import write_whole

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

COMMIT_FILE, SET_FILE, FORMAT_VERSION = "commit.json", "set.json", 1


class BlindError(TurnoutError):
    """A blind set does not match its seals, or cannot be kept blind."""

    def __init__(self, path: str | Path, where: str, problem: str, remedy: str) -> None:
        super().__init__(f"{path}, {where}: {problem}. {remedy}.")


def digest(data: bytes) -> str:
    """SHA-256 of bytes as hex.

    Parameters
    ----------
    data : bytes
        Content.

    Returns
    -------
    str
        64 hexadecimal digits.

    Examples
    --------
    >>> digest(b"abc")[:16]
    'ba7816bf8f01cfea'
    """
    return hashlib.sha256(data).hexdigest()


def digest_of_folder(folder: str | Path, pattern: str = "*") -> str:
    """SHA-256 over names and contents of all matching files below ``folder``, sorted by name, without caches.

    Parameters
    ----------
    folder : str or Path
        The folder.
    pattern : str
        Pattern of the file names.

    Returns
    -------
    str
        64 hexadecimal digits.
    """
    hasher = hashlib.sha256()
    for path in sorted(Path(folder).rglob(pattern)):
        if path.is_file() and "__pycache__" not in path.parts:
            hasher.update(f"{path.relative_to(folder).as_posix()}\0{digest(path.read_bytes())}\n".encode())
    return hasher.hexdigest()


def seed_for(tool_sha256: str) -> int:
    """Seed of the set for this version of the tool: it exists no earlier than the tool, and nobody chose it.

    Parameters
    ----------
    tool_sha256 : str
        Hash of the sources of the tool.

    Returns
    -------
    int
        The seed.
    """
    return int(digest(f"turnout blind {tool_sha256}".encode())[:15], 16)


def write_truth(folder: str | Path, name: str, content: Mapping[str, Any], seed: int) -> str:
    """Write a truth as ``name``.json with a nonce of 16 bytes.

    The nonce follows from the ``seed`` of the set.

    Parameters
    ----------
    folder : str or Path
        Folder of the truths.
    name : str
        Id of the case, or "set".
    content : mapping
        The truth.
    seed : int
        Seed of the set.

    Returns
    -------
    str
        SHA-256 of the file.
    """
    nonce = digest(f"nonce {seed} {name}".encode())[:32]
    data = json.dumps({**content, "nonce": nonce}, indent=1, sort_keys=True).encode() + b"\n"
    write_whole(Path(folder) / f"{name}.json", data)
    return digest(data)


def file_digests(case: str | Path) -> dict[str, str]:
    """Hashes of all files of a case.

    Parameters
    ----------
    case : str or Path
        Folder of the case.

    Returns
    -------
    dict
        SHA-256 by path below the case.
    """
    return {
        p.relative_to(case).as_posix(): digest(p.read_bytes()) for p in sorted(Path(case).rglob("*")) if p.is_file()
    }


def write_commit(out: str | Path, truths: Mapping[str, str], examines: str | None = None) -> str:
    """Write commit.json.

    Parameters
    ----------
    out : str or Path
        Folder of the set.
    truths : mapping
        SHA-256 of the truth of each case, and that of set.json under "set".
    examines : str or None
        Hash of the tool that the set was made for, None for any tool.

    Returns
    -------
    str
        Its SHA-256.
    """
    out = Path(out)
    package = Path(__file__).parent
    cases = {
        c: {"truth_sha256": truths[c], "files": file_digests(out / "cases" / c)} for c in sorted(truths) if c != "set"
    }
    content = {
        "format": FORMAT_VERSION,
        "set_sha256": truths["set"],
        "generator_sha256": digest_of_folder(package, "*.py"),
        "examines": examines,
        "cases": cases,
    }
    data = json.dumps(content, indent=1, sort_keys=True).encode() + b"\n"
    write_whole(out / COMMIT_FILE, data)
    return digest(data)


def read_commit(out: str | Path) -> dict[str, Any]:
    """Content of commit.json.

    Parameters
    ----------
    out : str or Path
        Folder of the set.

    Returns
    -------
    dict
        Its content.

    Raises
    ------
    BlindError
        If there is no such file.
    """
    path = Path(out) / COMMIT_FILE
    if not path.exists():
        raise BlindError(path, "the path", "there is no such file", "Make a set first: turnout blind make --out FOLDER")
    return json.loads(path.read_bytes())


def verify(out: str | Path, truth: str | Path) -> dict[str, Any]:
    """Truths by case, after comparing every truth and recording with its seal.

    Parameters
    ----------
    out : str or Path
        Folder of the set.
    truth : str or Path
        Folder of the truths.

    Returns
    -------
    dict
        Truth by case.

    Raises
    ------
    BlindError
        At the first truth or recording that does not match its seal.
    """
    check_seals(out, truth)
    return {case: json.loads((Path(truth) / f"{case}.json").read_bytes()) for case in read_commit(out)["cases"]}


def check_seals(out: str | Path, truth: str | Path) -> None:
    """Compare every truth and recording with its seal.

    Parameters
    ----------
    out : str or Path
        Folder of the set.
    truth : str or Path
        Folder of the truths.

    Raises
    ------
    BlindError
        At the first truth or recording that does not match its seal.
    """
    out, truth, commit = Path(out), Path(truth), read_commit(out)
    _check_seal(truth / SET_FILE, commit["set_sha256"])
    for case, seals in commit["cases"].items():
        _check_seal(truth / f"{case}.json", seals["truth_sha256"])
        digests = file_digests(out / "cases" / case)
        if set(digests) != set(seals["files"]):
            difference = sorted(set(digests) ^ set(seals["files"]))[0]
            raise BlindError(
                out / "cases" / case, difference, "a file that was added or taken away", "Take the sealed set again"
            )
        for name, sha in digests.items():
            if sha != seals["files"][name]:
                raise BlindError(out / "cases" / case, name, "not the sealed content", "Take the sealed set again")


def check_kind(out: str | Path, truth: str | Path, histories: bool) -> None:
    """Compare the kind of a set with the option that a step was given.

    Parameters
    ----------
    out : str or Path
        Folder of the set.
    truth : str or Path
        Folder of the truths, or of the revealed ones.
    histories : bool
        Whether the step expects histories.

    Raises
    ------
    BlindError
        The set is of the other kind. A folder without the truth of a set is no error here.
    """
    path = Path(truth) / SET_FILE
    if not path.is_file() or bool(json.loads(path.read_bytes()).get("histories")) == histories:
        return
    if histories:
        raise BlindError(out, "--histories", "this set has single campaigns, no histories", "Leave --histories out")
    raise BlindError(out, "--histories", "this set has histories", "Give --histories")


def _check_seal(path: Path, sha: str) -> None:
    if not path.exists():
        raise BlindError(path, "the path", "there is no such truth", "Give the folder of the truth with --truth")
    if digest(path.read_bytes()) == sha:
        return
    if path.name == SET_FILE:
        remedy = "Give the folder of its truth with --truth; if this is it, the set proves nothing"
        raise BlindError(path, "line 1", "the truth of another set, or not as it was sealed", remedy)
    raise BlindError(path, "line 1", "not the truth that was sealed", "This set proves nothing: make a new one")
