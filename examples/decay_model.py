"""Track decay rate of an infinite track, vertical or lateral: closed form for many frequencies at once.

A test compares it with the meshed track of the library (`turnout.simulate.decay_rate`). Lateral motion is that of the
same beam with the lateral stiffness of rail and fastening, without torsion and bending of the web.
"""

from dataclasses import dataclass

import numpy as np

from turnout.simulate.decay_rate import DISTANCES

BANDS = np.array([100, 125, 160, 200, 250, 315, 400, 500, 630, 800, 1000, 1250, 1600, 2000, 2500, 3150, 4000, 5000.0])
LINES = 5  # per band
SPACING = 0.6
MIRROR = np.array([[1.0], [-1.0], [1.0], [-1.0]])  # of deflection, rotation, moment and shear


@dataclass(frozen=True)
class Beam:
    """Rail 60E1 in one direction: EI [N m²], κGA [N], ρI [kg m], and its mass [kg/m]."""

    bending: float
    shear: float
    rotary: float
    mass: float = 60.2


VERTICAL = Beam(210e9 * 3.038e-5, 0.393 * 80.77e9 * 76.7e-4, 7850 * 3.038e-5)
LATERAL = Beam(210e9 * 5.12e-6, 0.4 * 80.77e9 * 76.7e-4, 7850 * 5.12e-6)


@dataclass(frozen=True)
class Support:
    """Per rail seat: springs [N/m] with loss factors, half a sleeper [kg]; ``rail_loss`` of the rail's bending.

    ``absorbers``: (mass [kg/m], frequency [Hz], loss factor) of tuned masses along the rail.
    """

    pad: float
    pad_loss: float
    mass: float
    ballast: float
    ballast_loss: float
    rail_loss: float
    absorbers: tuple = ()


def decay_rate(beam, support, bands=BANDS, lines=LINES):
    r"""Decay rate [dB/m] in third octaves, (n_band,): :math:`4.343 / \sum_n |A(x_n)|^2 \Delta x_n / |A(0)|^2`.

    The force acts between two supports; ``bands`` [Hz]. EN 15461, on the grid of `turnout.simulate.decay_rate`.
    """
    edge = 2.0 ** (1.0 / 6.0)
    frequency = (np.asarray(bands)[:, None] * np.geomspace(1.0 / edge, edge, lines)).ravel()
    h = responses(beam, support, frequency) * (frequency**2)[:, None]
    energy = np.mean(np.abs(h.reshape(len(bands), lines, -1)) ** 2, axis=1)
    x = SPACING * DISTANCES
    middle = 0.5 * (x[1:] + x[:-1])
    width = np.diff(np.concatenate([[x[0]], middle, [x[-1] + 0.5 * (x[-1] - x[-2])]]))
    return 4.343 / ((energy / energy[:, :1]) @ width)


def responses(beam, support, frequency):
    """(n_line, n_position) receptance of the infinite track at the positions of the grid; force between supports."""
    omega = 2.0 * np.pi * np.asarray(frequency)
    quarter = _transfer(_bending(omega, beam, support), 0.25 * SPACING)
    half = quarter @ quarter
    multiplier, here = _decaying_waves(half, seat(omega, support))
    ends = np.concatenate([here, -MIRROR * here], axis=2)
    amount = np.linalg.solve(ends, np.tile([[0.0], [0.0], [0.0], [-1.0]], (omega.size, 1, 1)))[:, :2, 0]
    step = MIRROR * (half @ (MIRROR * here))  # behind the support
    quarter_shapes = [step[:, 0, :]]
    for _ in range(3):
        step = quarter @ step
        quarter_shapes.append(step[:, 0, :])
    # quarters of a bay behind the support before the force
    bays, quarters = np.divmod(np.round(4.0 * DISTANCES).astype(int) + 2, 4)
    factors = np.concatenate([amount[None], np.broadcast_to(multiplier, (bays.max(), omega.size, 2))])
    powers = np.multiply.accumulate(factors)
    return np.sum(np.array(quarter_shapes)[quarters] * powers[bays], axis=2).T


def _decaying_waves(half, stiffness):
    r"""(n, 2) factors per bay of the two free waves that decay with x, (n, 4, 2) their states in the middle of a bay.

    Seen from there a bay is its own mirror image. So deflection and moment e, rotation and shear o have
    :math:`T_{ee} e = \tfrac12 (\mu + 1 / \mu) e` and :math:`o = 2 T_{oe} e / (\mu - 1 / \mu)`.
    """
    after = half.copy()  # half a bay and the support behind it
    after[:, 3] += stiffness[:, None] * half[:, 0]
    bay = half @ after
    a, b, c, d = (bay[:, i, k] for i in (0, 2) for k in (0, 2))
    mean, distance = 0.5 * (a + d), np.sqrt(0.25 * (a - d) ** 2 + b * c)
    cosine = np.array([mean + distance, mean - distance])
    root = np.sqrt(cosine - 1.0) * np.sqrt(cosine + 1.0)
    growth = np.where(np.abs(cosine + root) > np.abs(cosine - root), cosine + root, cosine - root)
    deflection, moment = np.broadcast_to(b, cosine.shape), cosine - a
    rotation, shear = (
        2.0 * (bay[:, k, 0] * deflection + bay[:, k, 2] * moment) / (1.0 / growth - growth) for k in (1, 3)
    )
    return (1.0 / growth).T, np.array([deflection, rotation, moment, shear]).transpose(2, 0, 1)


def _transfer(system, length):
    r"""(n, 4, 4) matrix exponential of ``system`` times ``length`` [m].

    Deflection and moment only act on rotation and shear, and the other way round. So the eigenvalues are
    :math:`\pm\lambda_1, \pm\lambda_2`, and the exponential is a polynomial of the third degree with these at its nodes.
    """
    square = system @ system
    mean = 0.5 * (square[:, 0, 0] + square[:, 2, 2])
    distance = np.sqrt(mean**2 - square[:, 0, 0] * square[:, 2, 2] + square[:, 0, 2] * square[:, 2, 0])
    squares = np.array([mean + distance, mean - distance])  # of the eigenvalues
    root = np.sqrt(squares)
    even, odd = np.cosh(root * length), np.sinh(root * length) / root
    slopes = [(f[0] - f[1]) / (2.0 * distance) for f in (even, odd)]
    constants = [f[0] - slope * squares[0] for f, slope in zip((even, odd), slopes)]
    (c2, c3), (c0, c1) = (np.array(c)[:, :, None, None] for c in (slopes, constants))
    return c0 * np.eye(4) + c2 * square + system @ (c1 * np.eye(4) + c3 * square)


def seat(omega, support):
    """(n,) dynamic stiffness under the rail of one support [N/m]."""
    pad = support.pad * (1.0 + 1j * support.pad_loss)
    below = support.ballast * (1.0 + 1j * support.ballast_loss) - omega**2 * support.mass
    return pad * below / (pad + below)


def _bending(omega, beam, support):
    """(n, 4, 4) first-order system of the rail's deflection, rotation, moment and shear along x."""
    system = np.zeros((omega.size, 4, 4), dtype=complex)
    lossy = 1.0 + 1j * support.rail_loss
    system[:, 0, 1] = 1.0
    system[:, 0, 3] = 1.0 / (beam.shear * lossy)
    system[:, 1, 2] = 1.0 / (beam.bending * lossy)
    system[:, 2, 1] = -(omega**2) * beam.rotary
    system[:, 2, 3] = -1.0
    push = -(omega**2) * beam.mass + 0j
    for mass, tuned, loss in support.absorbers:
        stiffness = (2.0 * np.pi * tuned) ** 2 * (1.0 + 1j * loss)
        push = push - mass * omega**2 * stiffness / (stiffness - omega**2)
    system[:, 3, 0] = push
    return system
