"""Calibrate a section of a simulated turnout to hammer tests, or to resonances and dampings."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from turnout.config.load import load_configuration
from turnout.config.schema import suggestion
from turnout.config.settings.identify import IdentifySettings
from turnout.config.settings.receptance import ReceptanceSettings
from turnout.errors import ConfigError, ReadError, SimulationError
from turnout.hammer_test import find_impacts, receptance_of
from turnout.modal import identify
from turnout.readers import read
from turnout.records import RawChannel, RawDescription, Receptance, Recording
from turnout.signal.cleaning import clean_recordings
from turnout.simulate import load_track
from turnout.simulate.calibration import Calibration, MeasuredReceptance, calibrate
from turnout.simulate.hammer import resolve_location
from turnout.simulate.modal_calibration import ModeFit, fit_modes
from turnout.simulate.parameters import track_path
from turnout.simulate.turnout_track import position_by_mounting
from turnout.stages.raw_files import require_file
from turnout.stages.requested_files import section_of
from turnout.stages.track_files import track_file

LOG = logging.getLogger("turnout.simulate")
CALIBRATION_BAND = (60.0, 800.0)  # Hz: receptance lines used
DEFAULT_CHANNELS = RawDescription(
    (
        RawChannel("hammer", "hammer", "force"),
        RawChannel("acc_1", "acc_1", "acceleration"),
        RawChannel("acc_2", "acc_2", "acceleration", mounting="rail head mid-span"),
    )
)


def resolve_track(track: str | None, turnout_id: str | None = None, config: str | Path = "config") -> Path:
    """Track file: the one asked for, else the turnout's own, else Tommerup's.

    Parameters
    ----------
    track : str or None
        Name or path of a track file, if one was asked for.
    turnout_id : str or None
        Turnout whose configuration applies, if any.
    config : str or Path
        Folder of the configuration.

    Returns
    -------
    Path
        Path of the file.

    Raises
    ------
    SimulationError
        There is no such file.
    """
    if turnout_id is not None:
        return track_file(load_configuration(config).turnout(turnout_id), track)
    return track_path(track or "tommerup")


def calibrate_to_files(
    track_name: str | Path,
    section: str,
    files: Iterable[str | Path],
    turnout_id: str | None = None,
    config: str | Path = "config",
) -> Calibration:
    r"""Calibrate a section of a track to hammer tests.

    The receptance is H1 of all accepted impacts; its random error is that of its coherence, :math:`\sigma = |H|
    \sqrt{(1-\gamma^2) / 2n\gamma^2}` (Bendat and Piersol, eq. 9.90), lines 60-800 Hz.

    Parameters
    ----------
    track_name : str or Path
        Name of the track, or path of its file.
    section : str
        Label of the section.
    files : iterable of str or Path
        Raw files of hammer tests at the section.
    turnout_id : str or None
        Turnout whose configuration applies, if any.
    config : str or Path
        Folder of the configuration.

    Returns
    -------
    Calibration
        Parameters of the section, with their errors.

    Raises
    ------
    SimulationError
        None of the files can be used, or a channel has too few accepted impacts.
    ReadError
        There is no such file, or it is a folder.
    ConfigError
        The turnout has no hammer tests in its layout, or no such section, or the name of a file states another one.
    """
    track = load_track(str(track_name))
    position, base = resolve_location(track, section)
    paths = [Path(file) for file in files]
    description, force, responses, settings = _channels(section, turnout_id, config, paths)
    recordings, rejected = _recordings(paths, description)
    if not recordings:
        raise SimulationError(f"calibration of {section}: no record can be used. {' '.join(rejected)}")
    if rejected:
        LOG.warning("not used: %s", " ".join(rejected))
    measured = []
    for name in responses:
        channel = recordings[0].channels[recordings[0].index(name)]
        response_position = channel.position
        if response_position is None:
            response_position = position_by_mounting(base, position, channel.mounting)
        impacts = [i for i in find_impacts(recordings, force, name, settings) if i.accepted]
        if len(impacts) < settings.minimum_impacts:
            raise SimulationError(f"calibration of {section}: {len(impacts)} accepted impacts in channel {name!r}.")
        measured.append(_receptance_data(receptance_of(impacts, settings), position, response_position))
    return calibrate(track, section, measured)


def _recordings(files: Iterable[str | Path], description: RawDescription) -> tuple[list[Recording], list[str]]:
    """(recordings of all files, errors of those that cannot be read)."""
    recordings: list[Recording] = []
    rejected: list[str] = []
    for file in (require_file(f).resolve() for f in files):  # a link may lead anywhere
        try:
            result = read(file.name, file.parent, description)
        except ReadError as error:
            rejected.append(str(error))
            continue
        rejected += map(str, result.errors)
        recordings += clean_recordings(result.recordings, LOG)
    return recordings, rejected


def calibrate_to_modes(
    track_name: str | Path,
    section: str,
    wanted: Mapping[str, tuple[float, float]],
) -> ModeFit:
    """Calibrate a section of a track to natural frequencies and dampings.

    Parameters
    ----------
    track_name : str or Path
        Name of the track, or path of its file.
    section : str
        Label of the section.
    wanted : mapping of str to tuple of (float, float)
        Natural frequency [Hz] and damping ratio by band.

    Returns
    -------
    ModeFit
        Parameters of the section, and the modes reached with them.
    """
    return fit_modes(load_track(str(track_name)), section, wanted, identified_modes)


def identified_modes(
    recordings: Sequence[Recording], force: str = "hammer", response: str = "acc_1"
) -> dict[str, tuple[float, float]]:
    """Modes of a hammer test, as the hammer stage identifies them.

    Parameters
    ----------
    recordings : sequence of Recording
        One recording per impact.
    force : str
        Name of the force channel.
    response : str
        Name of the acceleration channel.

    Returns
    -------
    dict of str to tuple of (float, float)
        Natural frequency [Hz] and damping ratio by band; empty without accepted impacts.
    """
    impacts = [i for i in find_impacts(recordings, force, response, ReceptanceSettings()) if i.accepted]
    if not impacts:
        return {}
    model = identify([i.decay for i in impacts], recordings[0].rate, IdentifySettings())
    return {mode.band: (mode.frequency, mode.damping) for mode in model.modes if mode.band in ("ballast", "railpad")}


def _channels(
    section: str, turnout_id: str | None, config: str | Path, files: Iterable[Path]
) -> tuple[RawDescription, str, tuple[str, ...], ReceptanceSettings]:
    if turnout_id is None:
        return DEFAULT_CHANNELS, "hammer", ("acc_1", "acc_2"), ReceptanceSettings()
    turnout = load_configuration(config).turnout(turnout_id)
    hammer = turnout.hammer
    if hammer is None:
        raise ConfigError(turnout.layout, "hammer", "the layout describes no hammer tests", "Add the part hammer")
    if section not in hammer.descriptions:
        problem = f"{section!r} is no section of {turnout_id}"
        raise ConfigError("calibrate", "--section", problem, suggestion(section, hammer.descriptions))
    for file in files:
        section_of(file, turnout, section, None)  # ConfigError if the name of a file states another one
    names = tuple(n for n in (hammer.response[section], hammer.validation[section]) if n)
    return hammer.descriptions[section], hammer.force[section], names, turnout.settings["receptance"]


def _receptance_data(receptance: Receptance, impact_position: float, response_position: float) -> MeasuredReceptance:
    inside = (receptance.frequency >= CALIBRATION_BAND[0]) & (receptance.frequency <= CALIBRATION_BAND[1])
    h, coherence = receptance.h1[inside], np.clip(receptance.coherence[inside], 1e-3, 1.0 - 1e-6)
    sd = np.abs(h) * np.sqrt((1.0 - coherence) / (2.0 * receptance.n * coherence))
    return MeasuredReceptance(receptance.frequency[inside], h, sd, impact_position, response_position)
