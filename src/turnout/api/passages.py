"""Analyse the passage of a train."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from turnout.config import TurnoutConfig
from turnout.config.settings.passage import PassageSettings
from turnout.passage.analysis import analyse
from turnout.passage.result import Passage, PassageSensor
from turnout.records import Recording
from turnout.stages.passage import sensors_of
from turnout.stages.passage_context import known_patterns

if TYPE_CHECKING:
    from turnout.passage.axle_patterns import Pattern


def analyse_passage(
    recording: Recording,
    turnout: TurnoutConfig | None = None,
    *,
    sensors: Sequence[PassageSensor] | None = None,
    patterns: Sequence[Pattern] | None = None,
    settings: PassageSettings | None = None,
) -> Passage:
    """Find the train in a recording: its axles, speed, direction, track and type.

    Parameters
    ----------
    recording : Recording
        Acceleration of one or more sensors along the track [m/s²]; other channels are ignored. It holds one passage.
    turnout : TurnoutConfig, optional
        ``load_configuration("config").turnout(id)``: its sensors and settings are used.
    sensors : sequence of PassageSensor, optional
        Name, section, position [m] and track of each channel. By default those of the turnout, or every accelerometer
        of the recording that has a position.
    patterns : sequence of Pattern, optional
        Axle patterns of known trains; by default those of the file that the settings name, if it is there.
    settings : PassageSettings, optional
        By default those of the turnout, or the defaults of section ``passage``.

    Returns
    -------
    Passage
        ``offsets`` (n_axle,) of the axles behind the first [m], ``speed`` [m/s] with its standard error, ``at_sensor``
        with the times of the axles (n_axle,) [s]. ``status`` is "rejected" or "partly" with ``findings``, where no
        train or only a part of it can be used.

    Raises
    ------
    ValueError
        If no accelerometer has a position, or the recording is longer than ``settings.longest``.
    ConfigError
        If the file of axle patterns cannot be used.

    Examples
    --------
    >>> import numpy as np, turnout
    >>> from turnout.records import Channel, Recording
    >>> rng = np.random.default_rng(3)
    >>> silence = Recording(rng.normal(size=(1, 4000)), 2e3, (Channel("A7", "acceleration", 24.6),), "passage")
    >>> turnout.analyse_passage(silence, patterns=())
    Passage(rejected: no_train)

    References
    ----------
    docs/passages.md.
    """
    if settings is None:
        settings = PassageSettings() if turnout is None else turnout.settings["passage"]
    if sensors is None:
        sensors = _sensors_of_recording(recording) if turnout is None else sensors_of(turnout)
    if recording.duration > settings.longest:
        raise ValueError(
            f"the recording lasts {recording.duration:.0f} s, more than {settings.longest:g} s: cut it into passages "
            "with turnout.stages.passage.trains_in"
        )
    known = known_patterns(settings.axle_patterns) if patterns is None else patterns
    return analyse(recording, sensors, known, settings)


def _sensors_of_recording(recording: Recording) -> tuple[PassageSensor, ...]:
    """The accelerometers of a recording that have a position, each as a section of its own."""
    rows = (recording.channels[row] for row in recording.of_quantity("acceleration"))
    sensors = tuple(PassageSensor(c.name, c.name, c.position) for c in rows if c.position is not None)
    if not sensors:
        raise ValueError("no accelerometer of the recording has a position: give a turnout, or sensors")
    return sensors
