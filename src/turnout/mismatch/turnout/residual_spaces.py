r"""Subspaces of the residual of a turnout: a force at a support, a fault of a channel, a wheel, one recording alone.

In a passage the force at a position x is free in time: all sensors respond by the track's transfer functions. In hammer
tests a change at x adds :math:`q(f)\,H_{bx}(f)\,H_{xs}(f)`, by reciprocity, with one free q(f) for all impacts b and
sensors s. This holds for a change of a support, a mass or a loose fastening alike.
"""

import numpy as np

from turnout.mismatch.engine.localization import Space
from turnout.mismatch.turnout import passage_band, receptance_observation
from turnout.mismatch.turnout.pseudo_forces import green
from turnout.mismatch.turnout.rail_roughness import amplitude_sd
from turnout.mismatch.turnout.wave_response import Carrier, shown_by
from turnout.mismatch.turnout.wheel_roughness import WHEEL_LEVEL

BEYOND = 8  # supports beyond the zone that a change of the whole track includes


def missing_sources(case, fit):
    """Spaces of all passages and of the hammer tests of a TrackCase."""
    for o in case.observations:
        if o.name in case.rollings:
            made = case.rollings[o.name]
            yield _forces(case, fit, made)
            yield _wheels(case, fit, made)
    pairs = [(o, case.pairs[o.name]) for o in case.observations if o.name in case.pairs]
    if pairs:
        yield from _changes(case, fit, pairs)


def _forces(case, fit, made):
    """Harmonics of each sensor over a passage.

    They are combined as a force at each support, a channel's fault, or freely.
    """
    n, n_sensor = made.time.size, len(made.sensors)
    step = made.clock / n
    lines = step * np.arange(np.ceil(passage_band.LOW / step), np.floor(1.1 * made.high / step) + 1)
    turn = 2.0 * np.pi * made.time[:, None] * lines
    one = np.sqrt(2.0 / n) * np.stack([np.cos(turn), np.sin(turn)], axis=-1).reshape(n, -1)
    columns = np.kron(np.eye(n_sensor), one)
    frequency, g = green(case, fit.values, fit.terms, made)
    g = g * shown_by(fit.values, fit.terms, made, frequency)[:, :, None, None]
    g = g[np.clip(np.searchsorted(frequency, lines), 0, frequency.size - 1), :, :, 0]
    parts, size = {("clock", made.name): None}, one.shape[1]
    for k, j in enumerate(case.zone.supports if n_sensor > 1 else ()):  # one sensor cannot locate a force
        seen = g[:, :, k] / np.sqrt(np.mean(np.abs(g[:, :, k]) ** 2, axis=1))[:, None]
        parts["place", _place(case, j)] = np.concatenate([_turned(row) for row in seen.T])
    for s, sensor in enumerate(made.sensors):
        parts["sensor", sensor.name] = np.eye(n_sensor * size)[:, s * size : (s + 1) * size]
    return Space((made.name,), columns, parts)


def _turned(transfer):
    """(2n, 2n) real matrix by which a complex transfer (n,) acts on cosines and sines."""
    found = np.zeros((2 * transfer.size, 2 * transfer.size))
    k = 2 * np.arange(transfer.size)
    found[k, k] = found[k + 1, k + 1] = transfer.real
    found[k, k + 1], found[k + 1, k] = transfer.imag, -transfer.imag
    return found


def _wheels(case, fit, made):
    """Waves of each wheel, which are errors of ordinary size in the model of the passage."""
    waves, carrier = case.waves, Carrier(case, fit.values, made, fit.terms)
    sd = np.repeat(amplitude_sd(waves.lengths, waves.length, WHEEL_LEVEL), 2)
    spectra = carrier.spectra(waves.lengths, np.ones(carrier.node.size))
    blocks = [carrier.shown(spectra, carrier.wheel(w)) * sd for w in range(carrier.behind.size)]
    train, parts, first = made.passage.train or made.passage.name, {}, 0
    every = np.eye(sum(b.shape[1] for b in blocks))
    for w, block in enumerate(blocks):
        parts["wheel", (train, w + 1)] = every[:, first : first + block.shape[1]]
        first += block.shape[1]
    return Space((made.name,), np.concatenate(blocks, axis=1), parts)


def _changes(case, fit, pairs):
    """A change at each support, of each channel, of all supports; in all tests or in those of one visit."""
    names = tuple(o.name for o, _ in pairs)
    heard_by, wide = case.blow_models(fit.values, fit.terms), _wide(case)
    through = [_through(case, fit, pair, heard_by(pair), wide) for _, pair in pairs]
    at = {j: [h[:, k] for h in through] for k, j in enumerate(wide)}
    whole = [h.sum(axis=1) for h in through]
    found = {("place", _place(case, j)): at[j] for j in case.zone.supports}
    found["frequency", "track"] = whole
    order = {o.name: k for k, o in enumerate(case.observations)}
    known = [_receptance(pair, fit.predictions[order[o.name]]) for o, pair in pairs]
    for channel in dict.fromkeys(pair.channel for _, pair in pairs):
        found["sensor", channel] = [h * (pair.channel == channel) for h, (_, pair) in zip(known, pairs)]
    visits = tuple(dict.fromkeys(pair.test.visit for _, pair in pairs))
    for visit in visits if len(visits) > 1 else ():
        found["condition", visit] = [h * (pair.test.visit == visit) for h, (_, pair) in zip(whole, pairs)]
    for key, changes in found.items():
        columns = np.concatenate([_lines(pair, h) for h, (_, pair) in zip(changes, pairs)])
        size = np.sqrt(np.sum(columns**2, axis=0))
        yield Space(names, columns[:, size > 0.0] / size[size > 0.0], {key: None})


def _through(case, fit, pair, heard, supports):
    """(n_line, n_support) receptance from impact to support times that from support to sensor, with the channel."""
    rows = [heard.model.matrices.index["rail", j] for j in supports]
    u, v = (heard.model.displacement(place)[:, rows] for place in (pair.test.place, heard.seats[pair.seat]))
    return u * v * case.chain(fit.values, fit.terms, pair)[:, None]


def _receptance(pair, predicted):
    """The predicted receptance on ``LINES``, 0 where it was not measured."""
    n, h = pair.lines.size, np.zeros(receptance_observation.LINES.size, dtype=complex)
    h[pair.lines] = (predicted[:n] + 1j * predicted[n:]) * pair.size
    return h


def _lines(pair, change):
    """(2n, 2 n_line) columns: change of a pair's observation per real and imaginary part of q on each line."""
    n, scaled = pair.lines.size, change[pair.lines] / pair.size
    found, k = np.zeros((2 * n, 2 * receptance_observation.LINES.size)), np.arange(n)
    found[k, 2 * pair.lines] = found[n + k, 2 * pair.lines + 1] = scaled.real
    found[n + k, 2 * pair.lines], found[k, 2 * pair.lines + 1] = scaled.imag, -scaled.imag
    return found


def _wide(case):
    """Supports of the zone and some beyond."""
    last = case.track().support.size
    return range(max(0, case.zone.first - BEYOND), min(last, case.zone.last + 1 + BEYOND))


def _place(case, support):
    return round(float(case.track().support[support]), 3)
