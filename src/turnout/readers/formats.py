"""Registry of the raw formats: module, file extensions and first bytes of each; detection of the format of a file.

A new format is one file with ``read_raw(source) -> RawFile`` and one line here. Spreadsheets, packed files and files of
known other kinds are rejected with what to do.
"""

import zipfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module

from turnout.readers.claims import check_claims
from turnout.readers.source import RawFile, RawRecord, Source
from turnout.readers.start_columns import with_axis_start
from turnout.readers.stated_starts import with_stated_start
from turnout.readers.stated_units import with_stated_units
from turnout.readers.stated_zones import with_stated_zone

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


@dataclass(frozen=True)
class Format:
    """``extensions`` are in lower case with a dot; ``signature(head)`` is True if the first bytes prove the format."""

    module: str
    extensions: tuple[str, ...]
    signature: Callable[[bytes], bool] = lambda head: False
    meaning: str = ""

    def read_raw(self, source: Source) -> RawFile:
        """The file's records, not converted. The module is imported only now: h5py alone costs 0.1 s.

        Parameters
        ----------
        source : Source
            The raw file.

        Returns
        -------
        RawFile
            The records as they are in the file, and the number of records that it states.

        Raises
        ------
        ReadError
            If the file as a whole cannot be read, claims more than it can hold, or has its samples in another file.
        """
        check_claims(self.module, source)
        raw = import_module(f"turnout.readers.{self.module}").read_raw(source)
        records = tuple(with_stated_units(r) if isinstance(r, RawRecord) else r for r in raw.records)
        if len(records) == 1 and isinstance(records[0], RawRecord):
            records = (with_stated_start(records[0]),)
        records = tuple(with_stated_zone(with_axis_start(r)) if isinstance(r, RawRecord) else r for r in records)
        return replace(raw, records=records)


def _is_hdf5(head: bytes) -> bool:
    return any(head[at : at + 8] == HDF5_SIGNATURE for at in (0, 512, 1024, 2048))


FORMATS = {
    "uff58": Format(
        "uff", (".uff", ".unv", ".uf", ".58"), lambda h: h.lstrip()[:2] == b"-1", "Universal File Format 58, 58b"
    ),
    "uff58b": Format("uff", (), meaning="Universal File Format 58b, binary"),
    "tdms": Format("tdms", (".tdms",), lambda h: h[:4] == b"TDSm", "National Instruments TDMS"),
    "mat73": Format("mat", (), lambda h: h[:10] == b"MATLAB 7.3", "MATLAB from version 7.3"),
    "mat": Format("mat", (".mat",), lambda h: h[:10] == b"MATLAB 5.0", "MATLAB version 5"),
    "rcmdx": Format("rcmdx", (".rcmdx",), lambda h: _is_hdf5(h) and b"RCMDX" in h, "RCM-DX, railways' exchange format"),
    "hdf5": Format("hdf5", (".h5", ".hdf5", ".hdf", ".he5"), _is_hdf5, "HDF5"),
    "wav": Format("wav", (".wav", ".rf64", ".flac"), lambda h: h[:4] in (b"RIFF", b"RF64", b"fLaC"), "WAV, FLAC"),
    "lvm": Format("lvm", (".lvm",), lambda h: h[:19] == b"LabVIEW Measurement", "LabVIEW measurement file"),
    "npz": Format("npz", (".npz",), lambda h: h[:4] == b"PK\x03\x04", "NumPy archive"),
    "parquet": Format("parquet", (".parquet", ".pq"), lambda h: h[:4] == b"PAR1", "Apache Parquet"),
    "csv": Format("csv", (".csv", ".txt", ".tsv", ".asc", ".dat"), meaning="text with separated columns"),
}


def detect_format(source: Source) -> Format:
    """The format of a file, by its first bytes or else by its extension.

    Parameters
    ----------
    source : Source
        The raw file.

    Returns
    -------
    Format
        The first entry of ``FORMATS`` that fits.

    Raises
    ------
    ReadError
        If neither the first bytes nor the extension are those of a known format.
    """
    head = source.head
    extension = source.path.suffix.lower()
    for entry in FORMATS.values():
        if entry.signature(head) and not (entry.module == "hdf5" and extension == ".rcmdx"):
            return entry
    for entry in FORMATS.values():
        if extension in entry.extensions:
            return entry
    names = ", ".join(FORMATS)
    raise source.error(
        "byte 0",
        f"neither its first bytes ({head[:8]!r}) nor its extension {extension!r} belong to a known format",
        f"Export the recording in one of the formats {names}; if it is in one of them, set 'format' in the layout",
    )


OLD_EXCEL = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
FIRST_ZIP_ENTRIES = (
    b"[Content_Types].xml",
    b"_rels/",
    b"docProps/",
    b"xl/",
    b"mimetypeapplication/vnd.oasis.opendocument",
)


def reject_spreadsheet(source: Source) -> None:
    """Stop if the first bytes are those of Excel or OpenDocument, whatever the name of the file.

    Parameters
    ----------
    source : Source
        The raw file.

    Raises
    ------
    ReadError
        If they are; the remedy is to export text.
    """
    zipped = source.head[:4] == b"PK\x03\x04" and source.head[30:].startswith(FIRST_ZIP_ENTRIES)
    if zipped or source.head.startswith(OLD_EXCEL):
        remedy = "Save it from the spreadsheet as CSV, text with separated columns"
        raise source.error("byte 0", "it is a spreadsheet's own file", remedy)


EXPORT = "Export the recording from the program that wrote it as UFF 58, TDMS, MATLAB, HDF5, Parquet, WAV or text"
OTHER_FILES = {  # first bytes: what the file is, what to do
    b"MDF     ": ("a measurement file of ASAM (MDF)", EXPORT),
    b"UnFinMF ": ("an unfinished measurement file of ASAM (MDF)", EXPORT),
    b"|CF,": ("a file of imc FAMOS", EXPORT),
    b"<?xml": ("an XML file, such as DIAdem's TDM or Somat's SIE", EXPORT),
    b"ARROW1\x00\x00": ("an Arrow or Feather file", "Write its table as Parquet"),
    b"\x93NUMPY": ("one NumPy array, without names of channels", "Save every channel under its name with numpy.savez"),
    b"SQLite format 3\x00": ("a database of SQLite", EXPORT),
    b"%PDF-": ("a PDF document", EXPORT),
    b"TDSh": ("the index of a TDMS file, without samples", "Copy the file with the ending .tdms instead"),
    b"version https://git-lfs": ("a pointer of Git LFS, without samples", "Fetch the file itself with 'git lfs pull'"),
    b"\x00\x05\x16\x07": ("macOS's notes on a file, without samples", "Remove it; the recording has no '._' in front"),
    b"L\x00\x00\x00\x01\x14\x02\x00": ("a shortcut of Windows, without samples", "Copy the file to which it points"),
    b"<!doctype html": ("a web page, such as that of a login", "Log in and download the recording again"),
    b"<html": ("a web page, such as that of a login", "Log in and download the recording again"),
}  # fmt: skip


def reject_other_file(source: Source) -> None:
    """Stop if the first bytes are those of a file of another kind, whatever its name.

    Parameters
    ----------
    source : Source
        The raw file.

    Raises
    ------
    ReadError
        If they are; the remedy says how to get a file that is read.
    """
    head = source.head.removeprefix(b"\xef\xbb\xbf").lstrip(b" \t\r\n")
    for start, (label, remedy) in OTHER_FILES.items():
        if head.startswith(start) or head[: len(start)].lower() == start:
            raise source.error("byte 0", f"it is {label}", remedy)


ARCHIVES = {  # first bytes: program
    b"\x1f\x8b": "gzip", b"BZh": "bzip2", b"\xfd7zXZ\x00": "xz", b"\x28\xb5\x2f\xfd": "Zstandard",
    b"\x04\x22\x4d\x18": "LZ4", b"7z\xbc\xaf\x27\x1c": "7-Zip", b"Rar!\x1a\x07": "RAR",
}  # fmt: skip
UNPACK = "Unpack it, and put the file that is in it in its place"


def reject_archive(source: Source) -> None:
    """Stop if a file is packed by a program for compression or archives, whatever its name.

    Parameters
    ----------
    source : Source
        The raw file.

    Raises
    ------
    ReadError
        If it is; the remedy is to unpack it.
    """
    program = next((name for start, name in ARCHIVES.items() if source.head.startswith(start)), "")
    if source.head[257:262] == b"ustar":
        program = "tar"
    if program:
        raise source.error("byte 0", f"it is packed by {program}", UNPACK)
    if source.head[:4] == b"PK\x03\x04":
        with source.parsed_by("zipfile"), zipfile.ZipFile(source.path) as archive:
            names = archive.namelist()
        if not any(name.endswith(".npy") for name in names):
            listed = ", ".join(map(repr, names[:MAX_LISTED]))
            raise source.error("byte 0", f"it is a ZIP archive with {listed}, and no archive of NumPy", UNPACK)


MAX_LISTED = 6  # members that a message names
