"""Which derivative of the displacement a response is, from the phase of the driving-point function.

A velocity in mm/s read as an acceleration in m/s² is of the size of an acceleration. Its phase is not.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from turnout.records import Rejection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.records import Impact

MIN_FREQUENCY, MAX_FREQUENCY = 30.0, 800.0  # Hz, where a hammer on a track and its accelerometer tell a phase
MAX_DELAY = 1e-4  # s, between two channels sampled together; 29 degrees at 800 Hz
ERRORS, MAX_PHASE_ERROR = 3.0, 0.3  # standard errors of a phase that noise explains, and the largest of them used [rad]
MIN_IMPACTS, MIN_LINES = 3, 20  # below them the phases tell nothing
# Share of the lines with a negative real part: passive structures have none, one line in fifty may be an interference.
REFUTED, SUPPORTED = 0.1, 0.02


class PhaseLines(NamedTuple):
    """Response per force ``h`` (n,) at ``frequency`` (n,) [Hz], with ``error`` (n,) of its phase [rad]."""

    frequency: np.ndarray
    h: np.ndarray
    error: np.ndarray


def judge_response_order(impacts: Sequence[Impact], response: str) -> tuple[Impact, ...]:
    """Reject a test whose response is no acceleration, if its phase is that of a velocity.

    The sign of the channel is left open, so a reversed acceleration is accepted; a displacement, which has its phase,
    is not found.

    Parameters
    ----------
    impacts : sequence of Impact
        All impacts of a test; the accepted ones are used.
    response : str
        Name of the response's channel, for the message.

    Returns
    -------
    tuple of Impact
        The impacts, with a rejection "out_of_scale" in the accepted ones of such a test.
    """
    accepted = [i for i in impacts if i.accepted]
    lines = phase_lines(accepted) if len(accepted) >= MIN_IMPACTS else None
    if lines is None or len(lines.frequency) < MIN_LINES or not is_velocity(lines):
        return tuple(impacts)
    share = even_order_share(lines)
    detail = (
        f"{response} has the phase of a velocity: as an acceleration beside the hammer it would feed energy into the "
        f"hammer at {100.0 * share:.0f} % of {len(lines.frequency)} frequencies, which no track can; set the "
        "analyser to acceleration, or export the acceleration; a response some tenths of a millisecond late or early "
        "has such a phase, too"
    )
    rejection = Rejection("out_of_scale", share, REFUTED, detail, response)
    return tuple(replace(i, rejections=(rejection,)) if i.accepted else i for i in impacts)


def phase_lines(impacts: Sequence[Impact]) -> PhaseLines:
    r"""Response per force of a test (H1) at the lines whose phase is known, with the error of the phase.

    .. math:: \sigma_\varphi = \sqrt{\frac{1 - \gamma^2}{2 n \gamma^2}}

    Parameters
    ----------
    impacts : sequence of Impact
        Impacts of one test; the force counts during the contact only.

    Returns
    -------
    PhaseLines
        Lines of 30 to 800 Hz below the band edge of the hammer.

    References
    ----------
    Bendat and Piersol, Random Data, 4th ed., eq. 9.91.
    """
    n, rate = min(i.force.size for i in impacts), impacts[0].rate
    force = np.zeros((len(impacts), n))
    for row, i in zip(force, impacts, strict=True):
        row[i.onset : i.contact_end + 1] = i.force[i.onset : min(i.contact_end + 1, n)]
    forces = np.fft.rfft(force, axis=1)
    responses = np.fft.rfft([i.acceleration[:n] for i in impacts], axis=1)
    frequency = np.fft.rfftfreq(n, 1.0 / rate)
    cross = np.sum(forces.conj() * responses, axis=0)
    powers = [np.maximum(np.sum(np.abs(x) ** 2, axis=0), 1e-300) for x in (forces, responses)]
    coherence = np.clip(np.abs(cross) ** 2 / (powers[0] * powers[1]), 1e-12, 1.0)
    error = np.sqrt((1.0 - coherence) / (2.0 * len(impacts) * coherence))
    highest = min(MAX_FREQUENCY, float(np.median([i.band_edge for i in impacts])))
    use = (frequency >= MIN_FREQUENCY) & (frequency <= highest) & (ERRORS * error < MAX_PHASE_ERROR)
    return PhaseLines(frequency[use], (cross / powers[0])[use], error[use])


def is_velocity(lines: PhaseLines) -> bool:
    """Whether the phase is that of a velocity of either sign, and not that of an acceleration or displacement.

    Parameters
    ----------
    lines : PhaseLines
        Response per force.

    Returns
    -------
    bool
        False also where no order explains the phase, as far from the hammer.
    """
    odd_share = min(active_share(lines, 1), active_share(lines, 3))
    return even_order_share(lines) >= REFUTED and odd_share <= SUPPORTED


def even_order_share(lines: PhaseLines) -> float:
    """The smaller ``active_share`` of a displacement and an acceleration, whose phases differ by the sign.

    Parameters
    ----------
    lines : PhaseLines
        Response per force.

    Returns
    -------
    float
        0 to 1.
    """
    return min(active_share(lines, 0), active_share(lines, 2))


def active_share(lines: PhaseLines, order: int) -> float:
    r"""Share of the lines at which a response of a derivative order would be that of an active structure.

    The force feeds energy into a passive structure at every frequency, so its driving-point mobility has a real part
    that is not negative,

    .. math:: \mathrm{Re}\, Y(\omega) \ge 0, \qquad Y = (i\omega)^{1 - n} H_n

    with the response per force :math:`H_n` for the n-th derivative of the displacement. The least share for any delay
    between the channels of at most ``MAX_DELAY`` counts.

    Parameters
    ----------
    lines : PhaseLines
        Response per force at the driving point.
    order : int
        0 for a displacement, 1 for a velocity, 2 for an acceleration. Two more have the reversed sign.

    Returns
    -------
    float
        0 for a passive structure, up to 1.

    References
    ----------
    Brune 1931, Synthesis of a finite two-terminal network: the impedance of a passive system is positive real.

    Examples
    --------
    A mass of 100 kg on a spring, its resonance at 160 Hz with a damping ratio of 0.1:

    >>> f = np.linspace(50.0, 500.0, 46)
    >>> receptance = 1.0 / (100.0 * ((2 * np.pi * 160.0) ** 2 * (1 + 0.2j * f / 160.0) - (2 * np.pi * f) ** 2))
    >>> velocity = PhaseLines(f, 2j * np.pi * f * receptance, np.zeros(46))
    >>> [round(active_share(velocity, order), 2) for order in range(4)]
    [0.24, 0.0, 0.74, 0.5]
    """
    omega = 2.0 * np.pi * lines.frequency
    phase = np.angle((1j) ** (1 - order) * lines.h)
    delays = np.linspace(-MAX_DELAY, MAX_DELAY, 9)[:, None]
    outside = np.cos(phase + omega * delays) < -np.sin(ERRORS * lines.error) - 1e-9
    return float(outside.mean(axis=1).min())
