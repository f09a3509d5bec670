"""What keeps a file from being read as text or as YAML at all, as errors that say what to do."""

from collections.abc import Iterator
from contextlib import contextmanager

from turnout.errors import ConfigError


@contextmanager
def legible(path: object, where: str) -> Iterator[None]:
    """Within it a file is read and parsed: ConfigError for ``path`` where it cannot be opened (at ``where``), is not
    UTF-8, holds a character that no YAML file may hold, or an anchor within itself."""
    from ruamel.yaml.reader import ReaderError

    try:
        yield
    except OSError as error:
        found = f"cannot be read: {error.strerror}"
        raise ConfigError(path, where, found, "Put a file of that name there, or take it away") from None
    except UnicodeDecodeError as error:
        raise ConfigError(path, f"byte {error.start}", "a byte that is not UTF-8", "Save the file as UTF-8") from None
    except ReaderError as error:
        found = f"the character {chr(error.character)!r}, which no YAML file may hold"
        raise ConfigError(path, f"character {error.position + 1}", found, "Take it away") from None
    except RecursionError:
        found = "content without an end, as of an anchor that holds itself"
        raise ConfigError(path, where, found, "Write the values out there") from None
