"""Track decay rates of one section in several campaigns as a case for the diagnosis: model and candidate changes."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from examples.decay_model import BANDS, LATERAL, VERTICAL, Support, decay_rate

from turnout.mismatch import Candidate, Case, Nuisance, Observation
from turnout.physics import Parameter

DIRECTIONS = {"vertical": VERTICAL, "lateral": LATERAL}
REFERENCE_TEMPERATURE = 10.0  # rail temperature at which the pads' values hold [°C]
SMOOTHING_OCTAVES = 0.5  # correlation length of the error of one campaign at one section [octaves]
MODEL_ERROR_SD = (
    (1600.0, 0.5),
    (np.inf, 1.0),
)  # (up to [Hz], sd of the model error [ln]): the beam model has no torsion
SOURCE = "Thompson 2009, Railway Noise and Vibration, chapters 3 and 7"
# Name -> (usual value, sd of its logarithm, meaning); concrete sleepers, hard pads, 60E1.
TRACK_PRIORS = {
    "vertical_pad": (8e8, 0.5, "vertical stiffness of a pad [N/m]"),
    "lateral_pad": (6e7, 0.5, "lateral stiffness of a fastening [N/m]"),
    "pad_loss": (0.2, 0.4, "loss factor of pads"),
    "mass": (150.0, 0.1, "half a sleeper [kg]"),
    "vertical_ballast": (1e8, 0.4, "ballast under half a sleeper [N/m]"),
    "lateral_ballast": (5e7, 0.5, "ballast against half a sleeper [N/m]"),
    "ballast_loss": (1.0, 0.4, "loss factor of ballast"),
    "rail_loss": (0.002, 1.0, "loss factor of the rail"),
}
TEMPERATURE_PRIORS = {
    "softening": (0.0, 0.005, "relative loss of pad stiffness per kelvin"),
    "calming": (0.0, 0.02, "relative loss of the pads' loss factor per kelvin"),
}


@dataclass(frozen=True)
class Change:
    """A change from a campaign on. ``family`` is a key of ``CHANGES``, ``amounts`` are its parameters."""

    family: str
    since: str
    amounts: tuple

    def sentence(self):
        """The change in words."""
        pairs = zip(CHANGES[self.family][1], self.amounts)
        amounts = ", ".join(f"{p.meaning} {v:.3g} {p.unit}".rstrip(" -") for p, v in pairs)
        return f"{CHANGES[self.family][0]} since {self.since}: {amounts}"


def _parameter(name, unit, low, high, meaning, prior=None, neutral=0.0):
    return Parameter(name, unit, neutral, (low, high), meaning, SOURCE, prior)


FACTOR = _parameter("log_factor", "-", -2.5, 2.5, "natural logarithm of the factor", (0.0, 0.7))
MASS = _parameter("mass", "kg/m", 0.0, 60.0, "mass", (15.0, 15.0))
LOSS = _parameter("loss", "-", 0.05, 2.0, "loss factor", (0.5, 0.5), neutral=0.5)
SOFTENING = _parameter("softening", "1/K", -0.06, 0.06, "loss of its stiffness per kelvin", (0.0, 0.02))


def _tuned_frequency(name):
    return _parameter(name, "ln(Hz)", np.log(200.0), np.log(6000.0), "ln frequency", (7.0, 0.8), neutral=7.0)


ABSORBER_PARAMETERS = (MASS, _tuned_frequency("tuned"), LOSS, SOFTENING)
# Family -> (description, parameters, starts)
CHANGES = {
    "vertical_pad": ("other vertical stiffness of the pads", (FACTOR,), ((0.7,), (-0.7,))),
    "lateral_pad": ("other lateral stiffness of the fastenings", (FACTOR,), ((0.7,), (-0.7,))),
    "pads": ("other pads, stiffer or softer both ways", (FACTOR,), ((0.7,), (-0.7,))),
    "pad_loss": ("other damping of the pads", (FACTOR,), ((0.7,), (-0.7,))),
    "ballast": ("other stiffness of the ballast", (FACTOR,), ((0.7,), (-0.7,))),
    "sleeper_mass": ("other sleepers, heavier or lighter", (FACTOR,), ((0.3,), (-0.3,))),
    "rail_loss": ("a damping layer on the rail", (_parameter("loss", "-", 0.0, 0.5, "loss factor", (0.03, 0.05)),),
                  ((0.01,), (0.1,))),
    "lateral_absorber": ("tuned masses along the rail that act laterally", ABSORBER_PARAMETERS,
                         tuple((10.0, np.log(f), 0.5, 0.0) for f in (600.0, 1250.0, 2500.0))),
    "vertical_absorber": ("tuned masses along the rail that act vertically", ABSORBER_PARAMETERS,
                          tuple((10.0, np.log(f), 0.5, 0.0) for f in (600.0, 1250.0, 2500.0))),
    "absorber": ("tuned masses along the rail that act both ways",
                 (MASS, _tuned_frequency("vertical"), _tuned_frequency("lateral"), LOSS, SOFTENING),
                 tuple((10.0, np.log(v), np.log(f), 0.5, 0.0)
                       for v, f in ((1250.0, 1250.0), (2500.0, 1250.0), (3500.0, 1250.0), (600.0, 600.0)))),
    "broad_absorber": ("masses along the rail tuned an octave apart, in equal parts, both ways", ABSORBER_PARAMETERS,
                       tuple((15.0, np.log(f), 0.5, 0.0) for f in (800.0, 1250.0, 2000.0))),
    "measured_gain": ("all decay rates measured otherwise", (FACTOR,), ((0.5,), (-0.5,))),
}  # fmt: skip


def candidates(dates):
    """Candidates: every change at every possible date."""
    result = []
    for family, (_, parameters, starts) in CHANGES.items():
        for since in dates:
            result.append(
                Candidate.of(
                    family, parameters, lambda psi, w=family, s=since: Change(w, s, tuple(psi.values())), starts,
                    {"since": since}, "condition", len(dates),
                )
            )  # fmt: skip
    return tuple(result)


def track_of(values, direction, temperature):
    """``Support`` of the track from nuisance parameters, at a rail temperature [°C]."""
    t = {name: value * np.exp(values[name]) for name, (value, *_) in TRACK_PRIORS.items()}
    temperature_rise = temperature - REFERENCE_TEMPERATURE
    return Support(
        t[f"{direction}_pad"] * np.exp(-values["softening"] * temperature_rise),
        t["pad_loss"] * np.exp(-values["calming"] * temperature_rise), t["mass"], t[f"{direction}_ballast"],
        t["ballast_loss"], t["rail_loss"],
    )  # fmt: skip


def apply_change(support, change, direction, temperature):
    """The track with one change in it."""
    a, family = change.amounts, change.family
    factor = float(np.exp(a[0])) if CHANGES[family][1][0] is FACTOR else 1.0
    if family in ("pads", f"{direction}_pad"):
        return replace(support, pad=support.pad * factor)
    if family == "pad_loss":
        return replace(support, pad_loss=support.pad_loss * factor)
    if family == "ballast":
        return replace(support, ballast=support.ballast * factor)
    if family == "sleeper_mass":
        return replace(support, mass=support.mass * factor)
    if family == "rail_loss":
        return replace(support, rail_loss=support.rail_loss + a[0])
    if family == "broad_absorber":
        centre = np.exp(a[1] - 0.5 * a[3] * (temperature - REFERENCE_TEMPERATURE))
        absorbers = tuple((a[0] / 3.0, float(centre * octave), a[2]) for octave in (0.5, 1.0, 2.0))
        return replace(support, absorbers=(*support.absorbers, *absorbers))
    if family in ("absorber", f"{direction}_absorber"):
        tuned = a[1] if family != "absorber" or direction == "vertical" else a[2]
        frequency = float(np.exp(tuned - 0.5 * a[-1] * (temperature - REFERENCE_TEMPERATURE)))
        return replace(support, absorbers=(*support.absorbers, (a[0], frequency, a[-2])))
    return support


@lru_cache(maxsize=4096)
def _log_decay_rate(direction, support):
    return np.log(decay_rate(DIRECTIONS[direction], support))


@dataclass(frozen=True)
class MeasuredRates:
    """Measured decay rates of one section, with their errors.

    ``log`` is {(direction, campaign): (n_band,)}. ``spread`` {direction: (n_band,)} is the sd from rail to rail.
    ``repeat`` {direction: (n_band,)} is the sd of the mean of a section that neighbouring bands share. ``temperature``
    is {(direction, campaign): °C}; ``campaigns`` are in order of time.
    """

    section: str
    log: dict
    spread: dict
    repeat: dict
    temperature: dict
    campaigns: tuple


def whitening(spread, repeat):
    r"""(n_band, n_band) :math:`C^{-1/2}` of the errors of one campaign at one section.

    :math:`C_{ij} = s_i^2 \delta_{ij} + r_i r_j \exp(-\Delta_{ij}^2 / 2 \ell^2)`: ``spread`` is independent from band to
    band, ``repeat`` is shared by neighbouring bands over half an octave.
    """
    octave = np.log2(BANDS)
    shared = np.exp(-0.5 * ((octave[:, None] - octave) / SMOOTHING_OCTAVES) ** 2)
    power, vectors = np.linalg.eigh(np.diag(spread**2) + np.outer(repeat, repeat) * shared)
    return (vectors / np.sqrt(power)) @ vectors.T


class DecayCase(Case):
    """Whitened logarithms of decay rates. The model error of each band is a nuisance parameter, equal in all campaigns.

    ``reserved`` is a campaign for the verification only; ``priors`` {name: (mean, sd)} come from ``calibrate``.
    """

    is_large = True

    def __init__(self, measured, reserved=None, priors=None, only=None):
        self.measured, campaigns = measured, only or measured.campaigns
        self.white = {d: whitening(measured.spread[d], measured.repeat[d]) for d in DIRECTIONS}
        by_campaign = {c: [self._observation(d, c) for d in DIRECTIONS] for c in campaigns}
        self.observations = tuple(o for c in campaigns if c != reserved for o in by_campaign[c])
        self.reserved = tuple(by_campaign[reserved]) if reserved else ()
        self.nuisances = tuple(_nuisances(priors or {}))
        self.candidates = candidates([c for c in measured.campaigns[1:] if c != reserved])

    def _observation(self, direction, campaign):
        key = direction, campaign
        cells = np.repeat(np.arange(6), 3)
        labels = {"frequency": np.array([f"{b:.0f} Hz" for b in BANDS[1::3]], dtype=object)}
        labels |= {"direction": np.full(6, direction, dtype=object), "condition": np.full(6, campaign, dtype=object)}
        return Observation(
            f"{direction} {campaign}", campaign, self.white[direction] @ self.measured.log[key], 1.0, 1.0, direction,
            {"rail_temperature": self.measured.temperature[key]}, cells, labels,
        )  # fmt: skip

    def predict(self, values, terms, observations):
        """Whitened logarithm of the decay rate of each band, with the changes up to the campaign."""
        return [self.white[o.data_type] @ self.logarithm(values, terms, o) for o in observations]

    def logarithm(self, values, terms, o):
        """(n_band,) logarithm of the decay rate of the model under the conditions of an observation."""
        temperature = o.covariates["rail_temperature"]
        support, gain = track_of(values, o.data_type, temperature), 0.0
        for change in terms:
            if o.condition >= change.since:
                support = apply_change(support, change, o.data_type, temperature)
                gain += change.amounts[0] if change.family == "measured_gain" else 0.0
        offset = np.array([values[f"{o.data_type}_{b:.0f}"] for b in BANDS])
        return _log_decay_rate(o.data_type, support) + offset + gain

    def nuisance_jacobian(self, values, terms, observations, base):
        """Derivatives: exact for the errors of the bands, by finite differences for the other parameters."""
        nuisances, jacobians = self.nuisances, [np.zeros((o.data.size, len(self.nuisances))) for o in observations]
        for k, nuisance in enumerate(nuisances):
            if nuisance.name in TRACK_PRIORS or nuisance.name in TEMPERATURE_PRIORS:
                step = 0.1 * nuisance.sd
                perturbed = self.predict({**values, nuisance.name: values[nuisance.name] + step}, terms, observations)
                for new, old, jacobian in zip(perturbed, base, jacobians):
                    jacobian[:, k] = (new - old) / step
            else:
                direction, band = nuisance.name.split("_")
                for o, jacobian in zip(observations, jacobians):
                    if o.data_type == direction:
                        jacobian[:, k] = self.white[direction][:, BANDS == float(band)][:, 0]
        return jacobians


def _nuisances(priors):
    for name, (_, sd, meaning) in (TRACK_PRIORS | TEMPERATURE_PRIORS).items():
        mean, sd = priors.get(name, (0.0, sd))
        yield Nuisance(name, "ln" if name in TRACK_PRIORS else "1/K", mean, sd, meaning=meaning)
    for direction in DIRECTIONS:
        for band in BANDS:
            sd = next(s for top, s in MODEL_ERROR_SD if band <= top)
            name = f"{direction}_{band:.0f}"
            mean, sd = priors.get(name, (0.0, sd))
            yield Nuisance(name, "ln", mean, sd, meaning="error of the model in this band", can_mask=False)
