"""Files that no reader reads, recognised by their content whatever their names: spreadsheets, packed files and others.

A new foreign format is one line of ``FOREIGN_FORMATS``.
"""

import zipfile
from dataclasses import dataclass

from turnout.readers.source import Source

ZIP_START = b"PK\x03\x04"
ZIP_NAME_OFFSET = 30  # bytes from the start of a ZIP archive to the name of its first member
MAX_LISTED = 6  # members that a message names

TO_TEXT = "Save it from the spreadsheet as CSV, text with separated columns"
UNPACK = "Unpack it, and put the file that is in it in its place"
EXPORT = "Export the recording from the program that wrote it as UFF 58, TDMS, MATLAB, HDF5, Parquet, WAV or text"
LOG_IN = "Log in and download the recording again"


@dataclass(frozen=True)
class ForeignFormat:
    """``label`` completes "it is ..." in a message; ``remedy`` says how to get a file that is read.

    A file has this format if one of ``starts`` is at byte ``offset``, or if it is a ZIP archive and the name of its
    first member starts with one of ``zip_members``. With ``is_text``, a byte order mark and blanks may stand in front,
    and capital letters do not matter.
    """

    label: str
    remedy: str
    starts: tuple[bytes, ...] = ()
    offset: int = 0
    zip_members: tuple[bytes, ...] = ()
    is_text: bool = False

    def has_content(self, head: bytes) -> bool:
        """True if the first bytes of a file are those of this format.

        Parameters
        ----------
        head : bytes
            The first bytes.

        Returns
        -------
        bool
            Whether they prove the format.
        """
        if head.startswith(ZIP_START) and head.startswith(self.zip_members, ZIP_NAME_OFFSET):
            return True
        if self.is_text:
            head = head.removeprefix(b"\xef\xbb\xbf").lstrip(b" \t\r\n")
            return head.startswith(self.starts) or head.lower().startswith(self.starts)
        return head.startswith(self.starts, self.offset)


SPREADSHEET_MEMBERS = (
    b"[Content_Types].xml", b"_rels/", b"docProps/", b"xl/", b"mimetypeapplication/vnd.oasis.opendocument",
)  # fmt: skip
FOREIGN_FORMATS = (
    ForeignFormat(
        "a spreadsheet's own file", TO_TEXT, (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",), zip_members=SPREADSHEET_MEMBERS
    ),
    ForeignFormat("packed by tar", UNPACK, (b"ustar",), offset=257),
    ForeignFormat("packed by gzip", UNPACK, (b"\x1f\x8b",)),
    ForeignFormat("packed by bzip2", UNPACK, (b"BZh",)),
    ForeignFormat("packed by xz", UNPACK, (b"\xfd7zXZ\x00",)),
    ForeignFormat("packed by Zstandard", UNPACK, (b"\x28\xb5\x2f\xfd",)),
    ForeignFormat("packed by LZ4", UNPACK, (b"\x04\x22\x4d\x18",)),
    ForeignFormat("packed by 7-Zip", UNPACK, (b"7z\xbc\xaf\x27\x1c",)),
    ForeignFormat("packed by RAR", UNPACK, (b"Rar!\x1a\x07",)),
    ForeignFormat("a measurement file of ASAM (MDF)", EXPORT, (b"MDF     ",)),
    ForeignFormat("an unfinished measurement file of ASAM (MDF)", EXPORT, (b"UnFinMF ",)),
    ForeignFormat("a file of imc FAMOS", EXPORT, (b"|CF,",), is_text=True),
    ForeignFormat("an XML file, such as DIAdem's TDM or Somat's SIE", EXPORT, (b"<?xml",), is_text=True),
    ForeignFormat("an Arrow or Feather file", "Write its table as Parquet", (b"ARROW1\x00\x00",)),
    ForeignFormat(
        "one NumPy array, without names of channels",
        "Save every channel under its name with numpy.savez",
        (b"\x93NUMPY",),
    ),
    ForeignFormat(
        "a matrix of Matrix Market, without names of channels",
        "Write its columns as text, with a line of names above them",
        (b"%%matrixmarket",),
        is_text=True,
    ),
    ForeignFormat("a database of SQLite", EXPORT, (b"SQLite format 3\x00",)),
    ForeignFormat("a PDF document", EXPORT, (b"%PDF-",), is_text=True),
    ForeignFormat(
        "the index of a TDMS file, without samples", "Copy the file with the ending .tdms instead", (b"TDSh",)
    ),
    ForeignFormat(
        "a pointer of Git LFS, without samples",
        "Fetch the file itself with 'git lfs pull'",
        (b"version https://git-lfs",),
        is_text=True,
    ),
    ForeignFormat(
        "macOS's notes on a file, without samples",
        "Remove it; the recording has no '._' in front",
        (b"\x00\x05\x16\x07",),
    ),
    ForeignFormat(
        "a shortcut of Windows, without samples",
        "Copy the file to which it points",
        (b"L\x00\x00\x00\x01\x14\x02\x00",),
    ),
    ForeignFormat("a web page, such as that of a login", LOG_IN, (b"<!doctype html", b"<html"), is_text=True),
)


def reject_foreign_format(source: Source) -> None:
    """Stop if the content of a file is that of a format that no reader reads, whatever its name.

    A ZIP archive is one unless it holds arrays of NumPy.

    Parameters
    ----------
    source : Source
        The raw file.

    Raises
    ------
    ReadError
        If it is; the remedy says how to get a file that is read.
    """
    foreign_format = next((entry for entry in FOREIGN_FORMATS if entry.has_content(source.head)), None)
    if foreign_format is None and source.head.startswith(ZIP_START):
        foreign_format = _zip_without_arrays(source)
    if foreign_format is not None:
        raise source.error("byte 0", f"it is {foreign_format.label}", foreign_format.remedy)


def _zip_without_arrays(source: Source) -> ForeignFormat | None:
    with source.parsed_by("zipfile"), zipfile.ZipFile(source.path) as archive:
        names = archive.namelist()
    if any(name.endswith(".npy") for name in names):
        return None
    listed = ", ".join(map(repr, names[:MAX_LISTED]))
    return ForeignFormat(f"a ZIP archive with {listed}, and no archive of NumPy", UNPACK)
