"""Calibrate a section of a simulated turnout to hammer tests, or to resonances and dampings."""

import logging
from pathlib import Path

import numpy as np

from turnout.config.load import load_configuration
from turnout.config.settings.identify import IdentifySettings
from turnout.config.settings.receptance import ReceptanceSettings
from turnout.errors import ConfigError, ReadError, SimulationError
from turnout.hammer_test import find_impacts, receptance_of
from turnout.modal import identify
from turnout.readers import read
from turnout.records import RawChannel, RawDescription, Recording
from turnout.simulate import load_track
from turnout.simulate.calibration import MeasuredReceptance, calibrate
from turnout.simulate.hammer import resolve_location
from turnout.simulate.modal_calibration import fit_modes
from turnout.simulate.parameters import track_path
from turnout.stages.mismatch_inputs import track_file

LOG = logging.getLogger("turnout.simulate")
CALIBRATION_BAND = (60.0, 800.0)  # Hz: receptance lines used
DEFAULT_CHANNELS = RawDescription(
    (
        RawChannel("hammer", "hammer", "force"),
        RawChannel("acc_1", "acc_1", "acceleration"),
        RawChannel("acc_2", "acc_2", "acceleration", mounting="rail head mid-span"),
    )
)


def resolve_track(track, turnout_id=None, config="config"):
    """Track file: of ``track`` if given, else the turnout's own, else Tommerup's; SimulationError if there is none."""
    if turnout_id is not None:
        return track_file(load_configuration(config).turnout(turnout_id), track)
    return track_path(track or "tommerup")


def calibrate_to_files(track_name, section, files, turnout_id=None, config="config", seed=0):
    """``Calibration`` of ``section`` of a track, by name or file, to the hammer tests in ``files``.

    The receptance is H1 of all accepted impacts; its random error is that of its coherence,
    :math:`\\sigma = |H| \\sqrt{(1-\\gamma^2) / 2n\\gamma^2}` (Bendat and Piersol, eq. 9.90), lines 60-800 Hz.
    """
    track = load_track(str(track_name), seed=seed)
    position, _ = resolve_location(track, section)
    description, force, responses, settings = _channels(section, turnout_id, config)
    recordings, rejected = _recordings(files, description)
    if not recordings:
        raise SimulationError(f"calibration of {section}: no record can be used. {' '.join(rejected)}")
    if rejected:
        LOG.warning("not used: %s", " ".join(rejected))
    measured = []
    for name in responses:
        channel = recordings[0].channels[recordings[0].index(name)]
        response_position = channel.position
        if response_position is None:
            response_position = position + (0.3 if "mid-span" in channel.mounting else 0.0)
        impacts = [i for i in find_impacts(recordings, force, name, settings) if i.accepted]
        if len(impacts) < settings.minimum_impacts:
            raise SimulationError(f"calibration of {section}: {len(impacts)} sound impacts in channel {name!r}.")
        measured.append(_receptance_data(receptance_of(impacts, settings), position, response_position))
    return calibrate(track, section, measured)


def _recordings(files, description):
    """(recordings of all files, errors of those that cannot be read)."""
    recordings: list[Recording] = []
    rejected: list[str] = []
    for file in (Path(f).resolve() for f in files):  # a link may lead anywhere
        try:
            result = read(file.name, file.parent, description)
        except ReadError as error:
            rejected.append(str(error))
            continue
        recordings += result.recordings
        rejected += map(str, result.errors)
    return recordings, rejected


def calibrate_to_modes(track_name, section, wanted, seed=0, evaluations=14):
    """``ModeFit`` of ``section`` to the modes ``wanted``: {band: (frequency [Hz], damping ratio)}."""
    return fit_modes(load_track(str(track_name), seed=seed), section, wanted, identified_modes, evaluations=evaluations)


def identified_modes(recordings, force="hammer", response="acc_1"):
    """Band -> (frequency [Hz], damping ratio) of a hammer test, as the hammer stage identifies them."""
    impacts = [i for i in find_impacts(recordings, force, response, ReceptanceSettings()) if i.accepted]
    if not impacts:
        return {}
    model = identify([i.decay for i in impacts], recordings[0].rate, IdentifySettings())
    return {mode.band: (mode.frequency, mode.damping) for mode in model.modes if mode.band in ("ballast", "railpad")}


def _channels(section, turnout_id, config):
    if turnout_id is None:
        return DEFAULT_CHANNELS, "hammer", ("acc_1", "acc_2"), ReceptanceSettings()
    turnout = load_configuration(config).turnout(turnout_id)
    hammer = turnout.hammer
    if hammer is None:
        raise ConfigError(turnout.layout, "hammer", "nothing about hammer tests", "Add them to the layout")
    names = tuple(n for n in (hammer.response[section], hammer.validation[section]) if n)
    return hammer.descriptions[section], hammer.force[section], names, turnout.settings["receptance"]


def _receptance_data(receptance, impact_position, response_position):
    inside = (receptance.frequency >= CALIBRATION_BAND[0]) & (receptance.frequency <= CALIBRATION_BAND[1])
    h, coherence = receptance.h1[inside], np.clip(receptance.coherence[inside], 1e-3, 1.0 - 1e-6)
    sd = np.abs(h) * np.sqrt((1.0 - coherence) / (2.0 * receptance.n * coherence))
    return MeasuredReceptance(receptance.frequency[inside], h, sd, impact_position, response_position)
