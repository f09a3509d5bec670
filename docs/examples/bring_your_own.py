"""Your own simulator: three masses in a row, one spring of which hardens without the model knowing.

Run it: python docs/examples/bring_your_own.py. It takes some ten seconds and prints the verdict.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from turnout.config.settings.mismatch import MismatchSettings
from turnout.errors import SimulationError
from turnout.mismatch import Candidate, Case, Nuisance, Observation, diagnose
from turnout.physics import Parameter

RATE, N, MASS = 2000.0, 1000, np.array([4.0, 6.0, 3.0])  # samples per second, samples, three masses in a row [kg]
STEPS, NAMES = 4, ("play", "cubic", "friction")


@dataclass(frozen=True)
class Law:
    """Play [m], cubic spring [-] or dry friction [N] of size ``amount`` in ``spring`` 0, 1 or 2."""

    kind: str
    spring: int
    amount: float

    def sentence(self):
        return f"{self.kind} in spring {self.spring}"


@njit(cache=True)
def march(stiffness, damping, drive, mass, kinds, springs, amounts):
    """Positions (3, n) of three masses in a row, spring 0 to the ground, the last one driven; semi-implicit Euler."""
    x, v, out, dt = np.zeros(3), np.zeros(3), np.zeros((3, drive.size)), 1.0 / (RATE * STEPS)
    pull = np.zeros(4)
    for n in range(drive.size):
        for _ in range(STEPS):
            for k in range(3):
                stretch = x[k] - (x[k - 1] if k else 0.0)
                rate = v[k] - (v[k - 1] if k else 0.0)
                pull[k] = stiffness * stretch + damping * rate
                for m in range(kinds.size):
                    if springs[m] == k and kinds[m] == 0:  # what the spring does not do within the play
                        pull[k] -= stiffness * min(max(stretch, -amounts[m]), amounts[m])
                    elif springs[m] == k and kinds[m] == 1:
                        pull[k] += stiffness * amounts[m] * stretch * (stretch / 1e-3) ** 2
                    elif springs[m] == k:
                        pull[k] += amounts[m] * np.tanh(rate / 2e-3)
            pull[3] = drive[n]
            for k in range(3):
                v[k] += dt * (pull[k + 1] - pull[k]) / mass[k]
                x[k] += dt * v[k]
        out[:, n] = x
    return out


def simulate(stiffness, damping, drive, laws=()):
    """Positions (3, n) with the laws' forces."""
    kinds = np.array([NAMES.index(law.kind) for law in laws], dtype=np.int64)
    springs = np.array([law.spring for law in laws], dtype=np.int64)
    return march(stiffness, damping, drive, MASS, kinds, springs, np.array([law.amount for law in laws], dtype=float))


class Row(Case):
    """Conditions are levels of drive; outputs the first and the last mass; the nuisances stiffness and damping."""

    def __init__(self, recordings, reserved):
        self.drives = {name: drive for name, drive, _ in (*recordings, *reserved)}
        self.observations = tuple(self.observed(*r) for r in recordings)
        self.reserved = tuple(self.observed(*r) for r in reserved)
        self.nuisances = (
            Nuisance("stiffness", "-", 1.0, 0.2, bounds=(0.2, 5.0)),
            Nuisance("damping", "-", 1.0, 0.5, bounds=(0.0, 10.0)),
        )
        self.candidates = tuple(
            Candidate.of(
                kind,
                (Parameter("amount", unit, 0.0, bounds, "size of the effect", "example 2026"),),
                lambda psi, kind=kind, spring=spring: Law(kind, spring, **psi),
                starts,
                {"spring": spring},
                "place",
                n_scanned=3,
            )
            for kind, unit, bounds, starts in (
                ("play", "m", (0.0, 2e-3), ((1e-4,), (4e-4,))),
                ("cubic", "-", (-1.0, 20.0), ((0.3,), (3.0,))),
                ("friction", "N", (0.0, 100.0), ((5.0,), (30.0,))),
            )
            for spring in range(3)
        )

    def observed(self, name, drive, measured):
        data = measured[[0, 2]].ravel()
        return Observation(name, name, data, 0.02 * np.std(data), effective=0.1)

    def predict(self, values, terms, observations):
        stiffness, damping = values["stiffness"] * 4e5, values["damping"] * 60.0
        found = [simulate(stiffness, damping, self.drives[o.name], terms)[[0, 2]].ravel() for o in observations]
        if not all(np.max(np.abs(x)) < 0.1 for x in found):  # also where it is not a number
            raise SimulationError("the row flies apart")
        return found


def campaign(laws, seed=1):
    """Recordings of the true row: its springs and dampers are 6 and 20 % off the drawing's, 1 % noise."""
    rng, found = np.random.default_rng(seed), []
    for level in (30.0, 60.0, 120.0, 200.0):
        spectrum = np.fft.rfft(rng.normal(size=N)) * (np.fft.rfftfreq(N, 1.0 / RATE) < 120.0)
        drive = np.fft.irfft(spectrum, N)
        drive *= level / np.std(drive)
        x = simulate(1.06 * 4e5, 1.2 * 60.0, drive, laws)
        found.append((f"{level:.0f} N", drive, x + 0.01 * np.std(x) * rng.normal(size=x.shape)))
    return Row([found[0], found[1], found[3]], [found[2]])


if __name__ == "__main__":
    diagnosis = diagnose(campaign((Law("cubic", 1, 0.5),)), MismatchSettings(iterations=30, base_iterations=30))
    print(diagnosis)
    for term, estimate in zip(diagnosis.fit.terms, diagnosis.fit.estimates):
        print(f"   {term.sentence()}: {estimate}")
    fit = diagnosis.verification
    print(f"   fit on the held-out recording: {fit.before:.1f} % without it, {fit.after:.1f} % with it")
