"""Elements of a MATLAB 5 file, unpacked and checked before a library parses them.

scipy parses elements while it unpacks them, before their checksum is known, and a wrong size in a tag can end the
process. Therefore each element is unpacked here, and its tags must fit into each other. Layout: MathWorks, "MAT-File
Format", version 5.
"""

import math
import struct
import zlib

from turnout.readers.declared_sizes import check_size
from turnout.readers.source import COPY_AGAIN, Source

HEADER_SIZE = 128  # bytes: text, version and byte order
MATRIX, COMPRESSED = 14, 15  # types of elements
INT8, INT32, UINT32, UTF8 = 1, 5, 6, 16
# Type of an element -> bytes of a number.
NUMBER_SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}
TEXT_TYPES = {1, 2, 3, 4, 16, 17, 18}
CELL, STRUCTURE, TEXT, OPAQUE = 1, 2, 4, 17  # classes of arrays; the last is that of objects
NUMERIC_CLASSES = range(6, 16)
IS_COMPLEX = 1 << 11  # bit of the array flags
MAX_DIMENSIONS = 32
MAX_DEPTH = 20  # cells within cells


def unpacked_file(source: Source) -> tuple[bytes, dict[str, str]]:
    """The file with all elements unpacked, and the variables that are objects, which are left out of it.

    Parameters
    ----------
    source : Source
        The MATLAB 5 file.

    Returns
    -------
    tuple of (bytes, dict of str to str)
        A MATLAB 5 file without compression; name of each object -> name of its class.

    Raises
    ------
    ReadError
        If an element is damaged or ends behind the file.
    """
    data = source.data
    order = "<" if data[126:128] == b"IM" else ">"
    pieces, position, total = [data[:HEADER_SIZE]], HEADER_SIZE, 0
    objects: dict[str, str] = {}
    while position < len(data):
        try:
            if position + 8 > len(data):
                raise ValueError("its tag is cut off")
            element_type, size = struct.unpack_from(f"{order}II", data, position)
            if element_type not in (MATRIX, COMPRESSED) or position + 8 + size > len(data):
                raise ValueError(f"an element of type {element_type} with {size} bytes does not fit into the file")
            element = data[position : position + 8 + size]
            if element_type == COMPRESSED:
                claimed = _claimed_size(element[8:], order)
                check_size(total := total + claimed, source, f"the variable at byte {position}")
                element = _unpack(element[8:], claimed)
            _check_matrix(element, 0, len(element), order, 0)
            name, class_name = _object_names(element, order)
        except (ValueError, struct.error, zlib.error) as error:
            problem = f"it is damaged ({error})"
            raise source.error(f"the variable at byte {position}", problem, COPY_AGAIN, reason="unreadable") from error
        if name:
            objects[name] = class_name
        else:
            pieces.append(element)
        position += 8 + size
    return b"".join(pieces), objects


def _claimed_size(packed: bytes, order: str) -> int:
    """Bytes of the element in packed bytes, its tag included, as the tag states."""
    tag = zlib.decompressobj().decompress(packed, 8)
    if len(tag) < 8:
        raise ValueError("its tag is cut off")
    return 8 + struct.unpack(f"{order}II", tag)[1]


def _unpack(packed: bytes, size: int) -> bytes:
    """The element in packed bytes, of which no more than ``size`` are unpacked."""
    unpacker = zlib.decompressobj()
    element = unpacker.decompress(packed, size)
    remainder = unpacker.decompress(unpacker.unconsumed_tail, 8)  # reads the checksum
    if len(element) != size or len(remainder) > 7 or not unpacker.eof:
        raise ValueError(f"{len(element) + len(remainder)} of {size} bytes are packed in it")
    return element


def _element(data: bytes, position: int, stop: int, order: str) -> tuple[int, int, int, int]:
    """(type, first byte of the content, its size, position of the next element) of the element at ``position``."""
    element_type, size = struct.unpack_from(f"{order}II", data, position)
    if element_type >> 16:  # small element: size, type and up to four bytes of content
        element_type, size = element_type & 0xFFFF, element_type >> 16
        begin, following = position + 4, position + 8
        if size > 4:
            raise ValueError(f"a small element holds {size} bytes")
    else:
        begin, following = position + 8, position + 8 + size + (-size % 8 if element_type != MATRIX else 0)
    if begin + size > stop:
        raise ValueError(f"an element of {size} bytes ends behind its array")
    return element_type, begin, size, following


def _check_matrix(data: bytes, position: int, stop: int, order: str, depth: int) -> int:
    """Position behind the array at ``position``; ValueError if the tags in it do not fit into each other."""
    element_type, begin, size, following = _element(data, position, stop, order)
    if element_type != MATRIX or depth > MAX_DEPTH:
        raise ValueError(f"an element of type {element_type} stands for an array")
    if not size:
        return following
    end = begin + size
    element_type, flags_at, n_flag, position = _element(data, begin, end, order)
    if element_type != UINT32 or n_flag != 8:
        raise ValueError("an array has no flags")
    (flags,) = struct.unpack_from(f"{order}I", data, flags_at)
    array_class = flags & 0xFF
    if array_class not in (CELL, STRUCTURE, TEXT, *NUMERIC_CLASSES):
        return _check_parts(data, position, end, following, order, depth)
    element_type, at, n_byte, position = _element(data, position, end, order)
    if element_type != INT32 or n_byte % 4 or not 8 <= n_byte <= 4 * MAX_DIMENSIONS:
        raise ValueError("an array has no dimensions")
    shape = struct.unpack_from(f"{order}{n_byte // 4}i", data, at)
    if min(shape) < 0:
        raise ValueError(f"an array has the dimensions {shape}")
    count = math.prod(shape)
    element_type, _, _, position = _element(data, position, end, order)
    if element_type not in (INT8, UTF8):
        raise ValueError("an array has no name")
    if array_class in (CELL, STRUCTURE):
        if array_class == STRUCTURE:
            n_field, position = _field_count(data, position, end, order)
            count *= n_field
        if count * 8 > size:
            raise ValueError(f"{count} cells do not fit into {size} bytes")
        for _ in range(count):
            position = _check_matrix(data, position, end, order, depth + 1)
        return following
    for _ in range(2 if flags & IS_COMPLEX and array_class != TEXT else 1):
        element_type, _, n_byte, position = _element(data, position, end, order)
        if array_class == TEXT:
            if element_type not in TEXT_TYPES:
                raise ValueError(f"a text has the type {element_type}")
        elif element_type not in NUMBER_SIZES or n_byte != count * NUMBER_SIZES[element_type]:
            raise ValueError(f"{n_byte} bytes of type {element_type} for {count} numbers")
    return following


def _object_names(element: bytes, order: str) -> tuple[str, str]:
    """(name, name of the class) of a variable that is an object; ("", "") for any other variable."""
    _, begin, size, _ = _element(element, 0, len(element), order)
    if not size:
        return "", ""
    _, flags_at, _, position = _element(element, begin, len(element), order)
    if struct.unpack_from(f"{order}I", element, flags_at)[0] & 0xFF != OPAQUE:
        return "", ""
    texts = []
    for _ in range(3):  # name, system of types, class
        _, at, length, position = _element(element, position, len(element), order)
        texts.append(element[at : at + length].decode("utf-8", "replace"))
    return texts[0], texts[2]


def _check_parts(data: bytes, position: int, stop: int, following: int, order: str, depth: int) -> int:
    """``following``, if all parts of an object, function or sparse matrix end within it."""
    while position + 8 <= stop:
        element_type, _, _, behind = _element(data, position, stop, order)
        position = _check_matrix(data, position, stop, order, depth + 1) if element_type == MATRIX else behind
    return following


def _field_count(data: bytes, position: int, stop: int, order: str) -> tuple[int, int]:
    """(number of fields of a structure, position behind their names)."""
    element_type, at, size, position = _element(data, position, stop, order)
    if element_type != INT32 or size != 4:
        raise ValueError("a structure has no fields")
    (length,) = struct.unpack_from(f"{order}i", data, at)
    element_type, _, size, position = _element(data, position, stop, order)
    if element_type != INT8 or length < 1 or size % length:
        raise ValueError("a structure has no names of fields")
    return size // length, position
