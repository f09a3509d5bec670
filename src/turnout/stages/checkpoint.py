"""Store the fits of a diagnosis on disk, so that an interrupted one can continue."""

import hashlib
import pickle
from collections.abc import MutableMapping


class Checkpoint(MutableMapping):
    """A mapping whose values are files below ``folder``; files of another ``version`` are ignored.

    A value is written completely or not at all. The files are pickles: only files that this program wrote are read.
    """

    def __init__(self, folder, name, version=()):
        digest = hashlib.sha256(repr(tuple(version)).encode()).hexdigest()[:12]
        self.folder = folder / f"{name}-{digest}"
        self.cache = {}

    def _path(self, key):
        return self.folder / (hashlib.sha256(key.encode()).hexdigest()[:24] + ".fit")

    def __getitem__(self, key):
        if key not in self.cache:
            try:
                self.cache[key] = pickle.loads(self._path(key).read_bytes())
            except (FileNotFoundError, EOFError, pickle.UnpicklingError):
                raise KeyError(key) from None
        return self.cache[key]

    def __setitem__(self, key, value):
        self.cache[key] = value
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self._path(key)
        unfinished = path.with_suffix(".tmp")
        unfinished.write_bytes(pickle.dumps(value))
        unfinished.replace(path)

    def __delitem__(self, key):
        del self.cache[key]
        self._path(key).unlink(missing_ok=True)

    def __iter__(self):
        return iter(self.cache)

    def __len__(self):
        return len(self.cache)

    def discard(self):
        """Delete all values and the folder."""
        if self.folder.is_dir():
            for path in self.folder.iterdir():
                path.unlink()
            self.folder.rmdir()
        self.cache.clear()


class Replay(Checkpoint):
    """A checkpoint for many large values: nothing stays in memory."""

    def __getitem__(self, key):
        try:
            return super().__getitem__(key)
        finally:
            self.cache.clear()

    def __setitem__(self, key, value):
        super().__setitem__(key, value)
        self.cache.clear()
