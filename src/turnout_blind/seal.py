"""Seal and verify a set: SHA-256 of every truth with its nonce, and of every file."""

import hashlib
import json
from pathlib import Path

from turnout.errors import TurnoutError

COMMIT_FILE, SET_FILE, FORMAT_VERSION = "commit.json", "set.json", 1


class BlindError(TurnoutError):
    """A blind set does not match its seals, or cannot be kept blind."""

    def __init__(self, path, where, problem, remedy):
        super().__init__(f"{path}, {where}: {problem}. {remedy}.")


def digest(data):
    """SHA-256 of bytes as hex.

    >>> digest(b"abc")[:16]
    'ba7816bf8f01cfea'
    """
    return hashlib.sha256(data).hexdigest()


def digest_of_folder(folder, pattern="*"):
    """SHA-256 over names and contents of all matching files below ``folder``, sorted by name, without caches."""
    hasher = hashlib.sha256()
    for path in sorted(Path(folder).rglob(pattern)):
        if path.is_file() and "__pycache__" not in path.parts:
            hasher.update(f"{path.relative_to(folder).as_posix()}\0{digest(path.read_bytes())}\n".encode())
    return hasher.hexdigest()


def seed_for(tool_sha256):
    """Seed of the set for this version of the tool: it exists no earlier than the tool, and nobody chose it."""
    return int(digest(f"turnout blind {tool_sha256}".encode())[:15], 16)


def write_truth(folder, name, content, seed):
    """Write ``content`` as ``name``.json with a nonce of 16 bytes; returns the SHA-256 of the file.

    The nonce follows from the ``seed`` of the set.
    """
    nonce = digest(f"nonce {seed} {name}".encode())[:32]
    data = json.dumps({**content, "nonce": nonce}, indent=1, sort_keys=True).encode() + b"\n"
    Path(folder).mkdir(parents=True, exist_ok=True)
    (Path(folder) / f"{name}.json").write_bytes(data)
    return digest(data)


def file_digests(case):
    """{path below the case: SHA-256} of all files of a case."""
    return {
        p.relative_to(case).as_posix(): digest(p.read_bytes()) for p in sorted(Path(case).rglob("*")) if p.is_file()
    }


def write_commit(out, truths, examines=None):
    """Write commit.json; returns its SHA-256.

    ``truths`` is {case: SHA-256 of its truth, "set": SHA-256 of set.json}. ``examines`` is the hash of the tool that
    the set was made for, None for any tool.
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
    (out / COMMIT_FILE).write_bytes(data)
    return digest(data)


def read_commit(out):
    """commit.json as a dictionary."""
    path = Path(out) / COMMIT_FILE
    if not path.exists():
        raise BlindError(path, "line 1", "no such file", "Make a set first: turnout blind make --out FOLDER")
    return json.loads(path.read_bytes())


def verify(out, truth):
    """Truths by case; BlindError at the first truth or recording that does not match its seal."""
    out, truth, commit = Path(out), Path(truth), read_commit(out)
    _check_seal(truth / SET_FILE, commit["set_sha256"])
    truths = {}
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
        truths[case] = json.loads((truth / f"{case}.json").read_bytes())
    return truths


def _check_seal(path, sha):
    if not path.exists():
        raise BlindError(path, "line 1", "no such truth", "Give the folder of the truth with --truth")
    if digest(path.read_bytes()) != sha:
        raise BlindError(path, "line 1", "not the truth that was sealed", "This set proves nothing: make a new one")
