"""Effects that are in no library: a name is withdrawn if a free force law explains held-out data beside it."""

import numpy as np
import pytest
from examples import oscillator_case as oscillator
from examples.oscillator_case import LAWS, OscillatorCase

from turnout.mismatch import diagnose
from turnout.mismatch.engine.decision import NAME_RULES
from turnout.mismatch.engine.decision_facts import NameEvidence
from turnout.mismatch.engine.rule import first_applicable

RATE, N, OMEGA = 500.0, 1500, 2.0 * np.pi * 20.0
SLIP = np.linspace(0.05, 1.0, 20) * 8.0 / OMEGA**2  # displacement at which each friction element slips
STIFFNESS, SHARE = OMEGA**2, 0.05  # of which elements that slip carry this share


def force(rng, level):
    """Random-phase multisine of 2 to 50 Hz."""
    t, lines = np.arange(N) / RATE, np.arange(2.0, 50.0, 0.5)
    u = np.sum(np.cos(2.0 * np.pi * lines[:, None] * t + rng.uniform(0.0, 2.0 * np.pi, lines.size)[:, None]), axis=0)
    return level * u / u.std()


def microslip(u, substeps=10):
    """Displacement of a mass on a spring and 20 elements of spring and dry friction (Iwan 1966), by small steps."""
    y = v = 0.0
    anchor, out, h = np.zeros(SLIP.size), np.zeros(u.size), 1.0 / RATE / substeps
    for n in range(u.size):
        out[n], following = y, u[min(n + 1, u.size - 1)]
        for s in range(substeps):
            anchor = np.clip(anchor, y - SLIP, y + SLIP)
            spring = (1.0 - SHARE) * STIFFNESS * y + SHARE * STIFFNESS * np.mean(y - anchor)
            v += h * (u[n] + (following - u[n]) * (s + 0.5) / substeps - 0.04 * OMEGA * v - spring)
            y += h * v
    return out


def records(seed, response, noise=0.001):
    rng, made = np.random.default_rng(seed), []
    for k in range(4):
        u = force(rng, 1.3 if k == 3 else 1.0)
        y = response(u)
        made.append((f"r{k}", f"level {k}", u, y + noise * y.std() * rng.normal(size=N)))
    return made


def verdicts(made, tolerance=0.02):
    inverse = 1.0 / OMEGA**2
    case = OscillatorCase(
        made[:3], made[3:], RATE, (18.0, 4.0), (0.03, 0.03), (inverse, 0.3 * inverse), tolerance=tolerance
    )
    return diagnose(case).verdicts


@pytest.mark.parametrize(("seed", "tolerance"), [(3, 0.02), (1, 0.05)])
def test_microslip_which_no_lumped_effect_describes_has_no_name(seed, tolerance):
    (verdict, *_) = verdicts(records(seed, microslip), tolerance)
    assert verdict.answer == "unknown" and "free_law_predicts_better" in verdict.trail


@pytest.mark.parametrize(("law", "amount"), [("quadratic_drag", 1.0)])
def test_an_effect_of_the_library_keeps_its_name(law, amount):
    index, scale = np.array([LAWS[law][0]]), 12.0 / OMEGA**2

    def response(u):
        steps = oscillator._step_inputs(u)
        return oscillator._simulate(steps, 1.0 / RATE, OMEGA, 0.02, 1.0, index, np.array([amount]), scale)

    (verdict,) = verdicts(records(2, response, noise=0.01))
    assert (verdict.answer, verdict.names, verdict.grade) == ("named", (law,), "A")


@pytest.mark.parametrize(
    ("excess", "free_share", "answer"), [(0.2, 0.02, "A"), (0.2, 0.04, "B"), (0.2, 0.06, "unknown"), (1.5, 0.0, "B")]
)
def test_grade_a_needs_more_than_a_residual_within_the_tolerance(excess, free_share, answer):
    class Score:
        is_unbounded, family = False, "law"
        candidate = type("C", (), {"naming": type("N", (), {"must_reach_control_level": False})})

    evidence = NameEvidence(Score(), excess, free_share)
    assert first_applicable(NAME_RULES, evidence).answer == answer
