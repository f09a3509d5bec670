"""Store the fits and rows of a diagnosis on disk, so that an interrupted one can continue.

A file is an npz archive: arrays as they are, all else as JSON. Reading one runs no code, whoever wrote it.
"""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Iterator, MutableMapping, Sequence
from dataclasses import fields
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from turnout.files import write_atomic
from turnout.mismatch.engine.fit import Fit

FORMAT, VERSION = "turnout checkpoint", 2  # version 1 were pickles; they are never read
SUFFIX = ".npz"
CONTENT = "content"  # member of the archive that holds the JSON


class Checkpoint(MutableMapping[str, Any]):
    """A mapping whose values are files below ``folder``; files of another ``version`` are ignored.

    A value is written completely or not at all. A file that is damaged, or of another format, counts as missing.

    Parameters
    ----------
    folder : Path
        Folder of all checkpoints.
    name : str
        Start of the name of this one's folder.
    version : sequence
        Whatever the values depend on.
    """

    def __init__(self, folder: Path, name: str, version: Sequence[object] = ()) -> None:
        digest = hashlib.sha256(repr((FORMAT, VERSION, *version)).encode()).hexdigest()[:12]
        self.folder = folder / f"{name}-{digest}"
        self.cache: dict[str, Any] = {}

    def _path(self, key: str) -> Path:
        return self.folder / (hashlib.sha256(key.encode()).hexdigest()[:24] + SUFFIX)

    def __getitem__(self, key: str) -> Any:
        if key not in self.cache:
            self.cache[key] = read_value(self._path(key))
        return self.cache[key]

    def __setitem__(self, key: str, value: Any) -> None:
        self.cache[key] = value
        self.folder.mkdir(parents=True, exist_ok=True)
        write_value(self._path(key), value)

    def __delitem__(self, key: str) -> None:
        del self.cache[key]
        self._path(key).unlink(missing_ok=True)

    def __iter__(self) -> Iterator[str]:
        return iter(self.cache)

    def __len__(self) -> int:
        return len(self.cache)

    def discard(self) -> None:
        """Delete all values and the folder."""
        if self.folder.is_dir():
            for path in self.folder.iterdir():
                path.unlink()
            self.folder.rmdir()
        self.cache.clear()


class Replay(Checkpoint):
    """A checkpoint for many large values: nothing stays in memory."""

    def __getitem__(self, key: str) -> Any:
        try:
            return super().__getitem__(key)
        finally:
            self.cache.clear()

    def __setitem__(self, key: str, value: Any) -> None:
        super().__setitem__(key, value)
        self.cache.clear()


def write_value(path: Path, value: Any) -> None:
    """Write a value as a file.

    Parameters
    ----------
    path : Path
        It is replaced as a whole.
    value : object
        None, bool, number, text, time, array, ``Fit`` without candidates, and lists, tuples and dicts of such.

    Raises
    ------
    TypeError
        The value holds something else; nothing is written.
    """
    arrays: list[np.ndarray] = []
    content = json.dumps({"format": FORMAT, "version": VERSION, "value": _pack(value, arrays)})
    members = {f"array_{k}": array for k, array in enumerate(arrays)}
    packed = np.frombuffer(content.encode(), dtype=np.uint8)
    write_atomic(path, lambda file: np.savez(file, **{CONTENT: packed}, **members))  # type: ignore[arg-type]


def read_value(path: Path) -> Any:
    """The value that ``write_value`` has written.

    Parameters
    ----------
    path : Path
        File of the value.

    Returns
    -------
    object
        Numbers and arrays to the last bit.

    Raises
    ------
    KeyError
        There is no such file, or it is damaged or of another format or version.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            content = json.loads(archive[CONTENT].tobytes())
            if (content["format"], content["version"]) != (FORMAT, VERSION):
                raise KeyError(str(path))
            return _unpack(content["value"], archive)
    except (OSError, EOFError, ValueError, TypeError, RuntimeError, zipfile.BadZipFile):
        raise KeyError(str(path)) from None


def _pack(value: Any, arrays: list[np.ndarray]) -> Any:
    """The value as JSON types; arrays are appended to ``arrays`` and referred to by number."""
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, list):
        return [_pack(v, arrays) for v in value]
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        arrays.append(np.asarray(value))
        return {"array": len(arrays) - 1}
    if isinstance(value, datetime):
        return {"time": value.isoformat()}
    if isinstance(value, tuple):
        return {"tuple": [_pack(v, arrays) for v in value]}
    if isinstance(value, dict):
        return {"dict": [[_pack(k, arrays), _pack(v, arrays)] for k, v in value.items()]}
    if isinstance(value, Fit):
        return {"fit": {f.name: _pack(getattr(value, f.name), arrays) for f in fields(Fit)}}
    raise TypeError(f"a checkpoint holds no {type(value).__name__}")


def _unpack(value: Any, archive: Any) -> Any:
    """The value of its JSON types."""
    if isinstance(value, list):
        return [_unpack(v, archive) for v in value]
    if not isinstance(value, dict):
        return value
    ((value_type, content),) = value.items()
    if value_type == "array":
        return archive[f"array_{content}"]
    if value_type == "time":
        return datetime.fromisoformat(content)
    if value_type == "tuple":
        return tuple(_unpack(v, archive) for v in content)
    if value_type == "dict":
        return {_unpack(k, archive): _unpack(v, archive) for k, v in content}
    if value_type == "fit":
        return Fit(**{name: _unpack(v, archive) for name, v in content.items()})
    raise ValueError(f"unknown type {value_type!r}")
