"""Which shard a turnout belongs to, and what the files of a shard are called."""

import re
import zlib

from turnout.errors import ConfigError

NAME = r"\d{2,4}of\d{2,4}"


def shard_of(turnout: str, shards: int) -> str:
    """Name of the shard of a turnout; the same in every process and on every machine.

    The check value of CRC-32 is cbf43926 for "123456789"; its last six bits are 38.

    >>> shard_of("123456789", 64)
    '38of64'
    """
    return shard_name(zlib.crc32(turnout.encode()) % shards, shards)


def shard_name(number: int, shards: int) -> str:
    """``number`` counts from 0."""
    return f"{number:02d}of{shards:02d}"


def shard_names(shards: int, turnouts=None) -> list[str]:
    """All shards, or those that the ``turnouts`` belong to."""
    if turnouts is None:
        return [shard_name(i, shards) for i in range(shards)]
    return sorted({shard_of(t, shards) for t in turnouts})


def parse(name: str) -> tuple[int, int]:
    """Number and count of a shard from its name."""
    if not re.fullmatch(NAME, name):
        raise ConfigError("shard", "name", repr(name), "Write a name like 00of64")
    number, count = name.split("of")
    return int(number), int(count)
