"""Evaluate a hammer test: impacts, receptance, modes."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import cast

from turnout import hammer_test
from turnout.config.settings.identify import IdentifySettings
from turnout.config.settings.receptance import ReceptanceSettings
from turnout.records import Impact, ModalModel, Receptance, Recording
from turnout.signal.cleaning import clean_recordings
from turnout.stages.hammer import identify_accepted

LOG = logging.getLogger("turnout.hammer")


class Impacts(tuple[Impact, ...]):
    """The impacts of one hammer test, in the order of the recordings."""

    __slots__ = ()

    @property
    def usable(self) -> tuple[Impact, ...]:
        """The impacts without rejection."""
        return tuple(impact for impact in self if impact.accepted)

    def __repr__(self) -> str:
        rejected = [f"{k} {impact.rejections[0].reason}" for k, impact in enumerate(self, 1) if impact.rejections]
        text = f"{len(rejected)} rejected: impact {', '.join(rejected)}" if rejected else "none rejected"
        return f"Impacts({len(self)}: {len(self) - len(rejected)} accepted, {text})"


def find_impacts(
    recordings: Recording | Iterable[Recording],
    force: str | None = None,
    response: str | None = None,
    settings: ReceptanceSettings | None = None,
) -> Impacts:
    """Find the impacts of one hammer test, measure them, and reject those that cannot be used.

    As in the hammer stage, single wrong samples are replaced first, and hum is subtracted. A warning of the log
    "turnout" states both (``turnout.signal.cleaning``). Any structure is allowed here. The command
    ``turnout hammer`` and the nightly run also judge whether the response is the acceleration of a track, of the right
    scale, not limited, and simultaneous with the force (``turnout.hammer_test.response_quality``).

    Parameters
    ----------
    recordings : Recording or iterable of Recording
        All recordings of the test together, with one impact each or many: impacts are compared with each other.
    force : str, optional
        Name of the channel of the hammer; by default the only channel of force.
    response : str, optional
        Name of the accelerometer at the impact; by default the only channel of acceleration.
    settings : ReceptanceSettings, optional
        Section ``receptance`` of the configuration; by default its defaults.

    Returns
    -------
    Impacts
        A tuple of ``Impact``. One that cannot be used has ``rejections``, each with a code of docs/reasons.md.

    Raises
    ------
    TypeError
        If an item is no recording.
    ValueError
        If there is no recording, or no or more than one channel of a quantity and none is named.
    KeyError
        If a recording has no channel of the name given.

    Examples
    --------
    A half-sine of 500 N that lasts 2 ms has an impulse of 2/pi N s.

    >>> import numpy as np, turnout
    >>> from turnout.records import Channel, Recording
    >>> rng, t = np.random.default_rng(1), np.arange(2000) / 10_000.0
    >>> f = 500.0 * np.sin(np.pi * (t - 0.01) / 2e-3) * ((t > 0.01) & (t < 0.012))
    >>> a = np.exp(-80.0 * (t - 0.01)) * np.sin(900.0 * (t - 0.01)) * (t > 0.01)
    >>> noise = rng.normal(size=(2, 2000)) * [[0.1], [1e-3]]
    >>> channels = Channel("hammer", "force"), Channel("rail", "acceleration")
    >>> impacts = turnout.find_impacts(Recording(np.stack([f, a]) + noise, 10_000.0, channels))
    >>> impacts, f"{impacts[0].impulse:.2f} N s"
    (Impacts(1: 1 accepted, none rejected), '0.64 N s')
    """
    listed = (
        [recordings]
        if isinstance(recordings, Recording)
        else _items_of_type(recordings, Recording, "recordings, as turnout.read gives them")
    )
    if not listed:
        raise ValueError("no recording is given")
    force = force or _only_channel(listed[0], "force", "force")
    response = response or _only_channel(listed[0], "acceleration", "response")
    clean = clean_recordings(listed, LOG, (force, response))
    return Impacts(hammer_test.find_impacts(clean, force, response, settings))


def _items_of_type(items: Iterable, wanted: type, words: str) -> list:
    """List of the items; TypeError if one is of another type than ``wanted``."""
    listed = list(items)
    for item in listed:
        if not isinstance(item, wanted):
            raise TypeError(f"{words}, are needed; got {item!r}")
    return listed


def _only_channel(recording: Recording, quantity: str, parameter: str) -> str:
    """Name of the only channel of a quantity; ValueError if there is none or more than one."""
    names = [recording.channels[row].name for row in recording.of_quantity(quantity)]
    if len(names) == 1:
        return names[0]
    if not names:
        known = ", ".join(f"{c.name} ({c.quantity})" for c in recording.channels)
        raise ValueError(f"the recording has no channel of {quantity}; it has {known}")
    raise ValueError(f"the recording has several channels of {quantity}: say {parameter}= one of {', '.join(names)}")


def receptance(impacts: Iterable[Impact], settings: ReceptanceSettings | None = None) -> Receptance:
    r"""Average the accepted impacts into receptance and coherence, and judge every line by its coherence.

    .. math:: H_{1} = \frac{G_{Fa}}{(i\omega + a)^2\, G_{FF}}, \qquad
        \gamma^2 = \frac{|G_{Fa}|^2}{G_{FF}\, G_{aa}}

    Parameters
    ----------
    impacts : iterable of Impact
        Those with rejections are left out.
    settings : ReceptanceSettings, optional
        Section ``receptance`` of the configuration; by default its defaults.

    Returns
    -------
    Receptance
        ``frequency`` [Hz], ``h1``, ``h2``, ``hv`` [m/N], ``coherence`` with its 95 % limits and ``passed``, the result
        of the gate: (n_frequency,) arrays. Nothing passes with fewer impacts than ``settings.minimum_impacts``.

    Raises
    ------
    TypeError
        If an item is no impact.
    ValueError
        If the impacts have different sampling rates.

    Examples
    --------
    A free mass of 4 kg has the receptance -1 / (m w²):

    >>> import numpy as np, turnout
    >>> from turnout.records import Impact
    >>> f = np.zeros(1000); f[10:40] = np.sin(np.pi * np.arange(30) / 30)
    >>> impact = Impact(f, f / 4.0, 1000.0, 10, 39, 40, 1.0, 0.03, 0.019, 0.0, 0.0, 40.0)
    >>> result = turnout.receptance([impact, impact, impact])
    >>> print((result.h1 * (2 * np.pi * result.frequency) ** 2).real[:3].round(9), result.n)
    [-0.25 -0.25 -0.25] 3

    References
    ----------
    Barkhordari et al., eqs. 1 to 3; docs/measuring.md.
    """
    return hammer_test.receptance_of(
        _items_of_type(impacts, Impact, "impacts, as turnout.find_impacts gives them"), settings
    )


def identify_modes(
    impacts: Iterable[Impact],
    settings: IdentifySettings | None = None,
    receptance_settings: ReceptanceSettings | None = None,
    method: str | None = None,
) -> ModalModel:
    r"""Identify the modes of a section, with their errors, from the free decays after the impacts.

    .. math:: y_k = \mathrm{Re} \sum_m \alpha_{im} z_{im}^k + \text{drift} + \text{noise}, \qquad
              x_{k+1} = A x_k, \quad y_k = c x_k

    It computes as the nightly run does. Impacts that the model does not describe are left out.

    Parameters
    ----------
    impacts : iterable of Impact
        From ``find_impacts``. Those with rejections are left out.
    settings : IdentifySettings, optional
        Section ``identify`` of the configuration; by default its defaults.
    receptance_settings : ReceptanceSettings, optional
        Section ``receptance``: its gate decides which modes are trusted; by default its defaults.
    method : "joint" or "paper", optional
        By default that of the settings.

    Returns
    -------
    ModalModel
        ``modes`` with frequency [Hz] and damping ratio [-], each with standard error and 95 % interval; the matrices
        ``a`` (order, order), ``b`` and ``c`` (order,); ``receptance``. ``status`` is "rejected", with the reasons in
        ``rejections``, where there are too few impacts or no modes.

    Raises
    ------
    TypeError
        If an item is no impact.
    ValueError
        For an unknown method, or impacts of different sampling rates.

    Examples
    --------
    Two damped vibrations of 150 and 600 Hz are found again.

    >>> import numpy as np, turnout
    >>> from turnout.records import Channel, Recording
    >>> rng, rate = np.random.default_rng(5), 20e3
    >>> t = np.arange(6000) / rate - 0.05
    >>> force = 6e3 * np.sin(np.pi * t / 1e-3) * ((t > 0.0) & (t < 1e-3))
    >>> unit = sum(a * np.exp(-z * 2 * np.pi * f * t) * np.sin(2 * np.pi * f * t) * (t > 0.0)
    ...            for f, z, a in ((150.0, 0.05, 20.0), (600.0, 0.03, 60.0)))
    >>> clean = np.stack([force, np.convolve(force, unit)[1000 : 7000] / rate])
    >>> channels = Channel("hammer", "force"), Channel("rail", "acceleration")
    >>> recordings = [Recording(clean + rng.normal(size=(2, 6000)) * [[2.0], [0.5]], rate, channels) for _ in range(6)]
    >>> model = turnout.identify_modes(turnout.find_impacts(recordings))
    >>> model.status, [f"{mode.band} {mode.frequency:.0f} Hz, {mode.damping:.3f}" for mode in model.modes]
    ('accepted', ['ballast 150 Hz, 0.050', 'railpad 600 Hz, 0.030'])

    References
    ----------
    Barkhordari et al., eqs. 4 to 9 (method "paper"); Juang and Pappa 1985; docs/decisions.
    """
    chosen = settings or IdentifySettings()
    if method is not None:
        if method not in ("joint", "paper"):
            raise ValueError(f"no method {method!r}; there are ['joint', 'paper']")
        chosen = replace(chosen, method=method)
    listed = cast(Sequence[Impact], _items_of_type(impacts, Impact, "impacts, as turnout.find_impacts gives them"))
    _, measured, model = identify_accepted(listed, receptance_settings or ReceptanceSettings(), chosen)
    return replace(model, receptance=measured)
