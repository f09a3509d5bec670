"""Registry of the raw formats: module, file extensions and first bytes of each; detection of the format of a file.

A new format is one file with ``read_raw(source) -> RawFile`` and one line here.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module

from turnout.readers.condition_units import with_converted_conditions
from turnout.readers.declared_sizes import check_declared_sizes
from turnout.readers.lost_entries import CONTROL_CHARACTER
from turnout.readers.source import RawFile, RawRecord, Source
from turnout.readers.split_starts import with_starts_of_records, with_stated_starts
from turnout.readers.start_columns import with_axis_start
from turnout.readers.stated_ends import with_stated_duration
from turnout.readers.stated_scales import with_named_factors
from turnout.readers.stated_sensitivities import with_named_sensitivities
from turnout.readers.stated_starts import with_declared_origins
from turnout.readers.stated_units import with_decoded_units, with_stated_units
from turnout.readers.stated_zones import with_stated_zone
from turnout.readers.unread_starts import with_unread_starts

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


@dataclass(frozen=True)
class Format:
    """``extensions`` are in lower case with a dot; ``signature(head)`` is True if the first bytes prove the format.

    ``is_binary``: no file of this format is a text.
    """

    module: str
    extensions: tuple[str, ...]
    signature: Callable[[bytes], bool] = lambda head: False
    meaning: str = ""
    is_binary: bool = False

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
        check_declared_sizes(self.module, source)
        raw = import_module(f"turnout.readers.{self.module}").read_raw(source)
        records = tuple(
            with_stated_units(
                with_named_sensitivities(with_named_factors(with_declared_origins(with_decoded_units(r))))
            )
            if isinstance(r, RawRecord)
            else r
            for r in raw.records
        )
        records = tuple(with_converted_conditions(r) if isinstance(r, RawRecord) else r for r in records)
        records = with_stated_starts(with_starts_of_records(records))
        records = tuple(with_stated_zone(with_axis_start(r)) if isinstance(r, RawRecord) else r for r in records)
        records = with_unread_starts(records)
        if len(records) == 1:
            records = tuple(with_stated_duration(r) if isinstance(r, RawRecord) else r for r in records)
        return replace(raw, records=records)


TEXT_REMEDY = "Give a table of text the extension .csv or .txt; copy any other file again from the logger"


def _is_hdf5(head: bytes) -> bool:
    return any(head[at : at + 8] == HDF5_SIGNATURE for at in (0, 512, 1024, 2048))


FORMATS = {
    "uff58": Format(
        "uff", (".uff", ".unv", ".uf", ".58"), lambda h: h.lstrip()[:2] == b"-1", "Universal File Format 58, 58b"
    ),
    "uff58b": Format("uff", (), meaning="Universal File Format 58b, binary"),
    "tdms": Format("tdms", (".tdms",), lambda h: h[:4] == b"TDSm", "National Instruments TDMS", is_binary=True),
    "mat73": Format("mat", (), lambda h: h[:10] == b"MATLAB 7.3", "MATLAB from version 7.3", is_binary=True),
    "mat": Format("mat", (".mat",), lambda h: h[:10] == b"MATLAB 5.0", "MATLAB version 5", is_binary=True),
    "rcmdx": Format(
        "rcmdx",
        (".rcmdx",),
        lambda h: _is_hdf5(h) and b"RCMDX" in h,
        "RCM-DX, railways' exchange format",
        is_binary=True,
    ),
    "hdf5": Format("hdf5", (".h5", ".hdf5", ".hdf", ".he5"), _is_hdf5, "HDF5", is_binary=True),
    "wav": Format(
        "wav", (".wav", ".rf64", ".flac"), lambda h: h[:4] in (b"RIFF", b"RF64", b"fLaC"), "WAV, FLAC", is_binary=True
    ),
    "lvm": Format("lvm", (".lvm",), lambda h: h[:19] == b"LabVIEW Measurement", "LabVIEW measurement file"),
    "npz": Format("npz", (".npz",), lambda h: h[:4] == b"PK\x03\x04", "NumPy archive", is_binary=True),
    "parquet": Format("parquet", (".parquet", ".pq"), lambda h: h[:4] == b"PAR1", "Apache Parquet", is_binary=True),
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
        If neither the first bytes nor the extension are those of a known format, or if a text has the extension of a
        format of binary numbers.
    """
    head = source.head
    extension = source.path.suffix.lower()
    for entry in FORMATS.values():
        if entry.signature(head) and not (entry.module == "hdf5" and extension == ".rcmdx"):
            return entry
    for entry in FORMATS.values():
        if extension not in entry.extensions:
            continue
        if not entry.is_binary or CONTROL_CHARACTER.search(head):
            return entry
        problem = (
            f"its extension {extension!r} is that of {entry.meaning}, and its first bytes are text ({head[:20]!r})"
        )
        raise source.error("byte 0", problem, TEXT_REMEDY)
    names = ", ".join(FORMATS)
    raise source.error(
        "byte 0",
        f"neither its first bytes ({head[:8]!r}) nor its extension {extension!r} belong to a known format",
        f"Export the recording in one of the formats {names}; if it is in one of them, set 'format' in the layout",
    )
