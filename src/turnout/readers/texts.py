"""Decoding of the texts in raw files, whose encoding no format states reliably."""

import codecs
from collections.abc import Sequence

# Windows-1252; the five bytes that it leaves out are control characters, as Windows reads them, and none is lost.
WESTERN = "".join(
    bytes([b]).decode("cp1252" if b not in (0x81, 0x8D, 0x8F, 0x90, 0x9D) else "latin-1") for b in range(256)
)
MIN_UTF16_SIZE = 16  # bytes: fewer do not tell the encoding


def decode_text(data: bytes) -> str:
    """Text of bytes: UTF-8 if they are valid UTF-8, else Windows-1252 of western loggers.

    Parameters
    ----------
    data : bytes
        A line, a name, a unit or another text of a file.

    Returns
    -------
    str
        The text without a byte order mark.

    Examples
    --------
    >>> decode_text("m/s²".encode("utf-8")), decode_text("m/s²".encode("latin-1"))
    ('m/s²', 'm/s²')
    """
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return codecs.charmap_decode(data, "strict", WESTERN)[0]


# Of letters that Windows-1252 does not have: Central European, Cyrillic, Greek, Turkish, Chinese, Japanese, Korean; and
# of DOS (western, Cyrillic) and of the Macintosh, which have ², µ, ° and other letters at other bytes.
OTHER_ENCODINGS = (
    *("cp1250", "cp1251", "cp1253", "cp1254", "gb18030", "big5", "cp932", "cp949"),
    *("cp437", "cp850", "cp866", "koi8_r", "mac_roman"),
)


def other_readings(text: str) -> tuple[str, ...]:
    """What a text that was decoded as Windows-1252 is in the other encodings of older loggers.

    Nothing in such a text says which is meant: only a name that is known beforehand decides.

    Parameters
    ----------
    text : str
        Decoded text.

    Returns
    -------
    tuple of str
        Empty for one in ASCII, and for one with a letter that Windows-1252 does not have.

    Examples
    --------
    >>> "力" in other_readings("力".encode("gbk").decode("cp1252")), other_readings("force")
    (True, ())
    """
    return tuple(reading for (reading,) in readings_together((text,)))


def readings_together(texts: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """What several texts of a file are in each of the other encodings, as ``other_readings``.

    Parameters
    ----------
    texts : sequence of str
        Decoded texts.

    Returns
    -------
    tuple of tuple of str
        For each encoding that all of the texts have.

    Examples
    --------
    >>> ("м/с2", "Н") in readings_together([text.encode("cp1251").decode("cp1252") for text in ("м/с2", "Н")])
    True
    """
    if all(map(str.isascii, texts)):
        return ()
    try:
        data = [bytes(map(WESTERN.index, text)) for text in texts]
    except ValueError:
        return ()
    readings = (tuple(text_bytes.decode(encoding, "replace") for text_bytes in data) for encoding in OTHER_ENCODINGS)
    return tuple(reading for reading in dict.fromkeys(readings) if "\ufffd" not in "".join(reading))


def wide_encoding(head: bytes) -> str:
    """Encoding of a text in UTF-16 or UTF-32, by its byte order mark or by the zero bytes of its letters in UTF-16.

    Parameters
    ----------
    head : bytes
        First bytes of the file.

    Returns
    -------
    str
        "" for another text.

    Examples
    --------
    >>> wide_encoding("force;rail".encode("utf-16-le")), wide_encoding(b"force;rail [m/s2]")
    ('utf-16-le', '')
    """
    if head[:4] in (codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE):
        return "utf-32"
    if head[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        return "utf-16"
    even, odd = head[0::2], head[1::2]
    if len(head) < MIN_UTF16_SIZE or max(even.count(0), odd.count(0)) < MIN_ZERO_SHARE * len(odd):
        return ""
    return "utf-16-le" if not even.count(0) else "utf-16-be" if not odd.count(0) else ""


MIN_ZERO_SHARE = 0.9  # of the high bytes of a text of numbers with some other letters
