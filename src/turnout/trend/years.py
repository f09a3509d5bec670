"""Rows of ``charts`` by year, so that a night writes only the years in which something changed."""

import hashlib
import zlib

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc


def split_by_year(rows: pa.Table) -> dict[int, pa.Table]:
    """The rows of each year of ``measured_at_utc``, in their order.

    >>> when = pa.array([0, 40_000_000_000_000], pa.timestamp("us"))
    >>> {year: part.num_rows for year, part in split_by_year(pa.table({"measured_at_utc": when})).items()}
    {1970: 1, 1971: 1}
    """
    year = pc.year(rows.column("measured_at_utc"))
    return {int(y.as_py()): rows.filter(pc.equal(year, y)) for y in sorted(pc.unique(year), key=lambda y: y.as_py())}


def digest(parts, *about) -> str:
    """Hash of the content of Arrow tables laid end to end, however they are cut, and of what else decides.

    >>> whole, other = pa.table({"z": [1.0, 2.0]}), pa.table({"z": [1.0, 3.0]})
    >>> digest([whole]) == digest([whole.slice(0, 1), whole.slice(1)]), digest([whole]) == digest([other])
    (True, False)
    """
    columns = [hashlib.blake2b(digest_size=16) for _ in (parts[0].columns if parts else ())]
    for part in parts:
        for found, column in zip(columns, part.columns):
            for chunk in column.chunks:
                found.update(_plain(chunk))
    whole = hashlib.blake2b(repr(about).encode(), digest_size=16)
    for found in columns:
        whole.update(found.digest())
    return whole.hexdigest()


def _plain(chunk) -> memoryview:
    """Bytes of the values one by one: NULL as NaN or 0, text as a hash of its own."""
    if pa.types.is_string(chunk.type) or pa.types.is_large_string(chunk.type):
        chunk = chunk.dictionary_encode()
    if pa.types.is_dictionary(chunk.type):
        texts = chunk.dictionary.to_pylist()
        names = np.array([zlib.crc32(str(text).encode()) for text in texts], dtype=np.uint32)
        return np.ascontiguousarray(names[chunk.indices.to_numpy(zero_copy_only=False)]).view(np.uint8).data
    if chunk.null_count:
        chunk = chunk.fill_null(float("nan") if pa.types.is_floating(chunk.type) else 0)
    return np.ascontiguousarray(chunk.to_numpy(zero_copy_only=False)).view(np.uint8).data
