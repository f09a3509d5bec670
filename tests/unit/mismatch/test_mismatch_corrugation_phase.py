"""Corrugation that its level reveals has the phase of the free waves of the rail in their band."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from turnout import physics
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.candidates.corrugation_phase import wave_in_band
from turnout.mismatch.turnout.candidates.rail_defects import RailScan
from turnout.mismatch.turnout.candidates.short_corrugation import short_corrugation_candidates
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.mismatch.turnout.rail_roughness import Waves

PLACES = (2.1, 4.2, 6.6, 9.0)
STRETCH = (3.0, 8.0)
LENGTH = 0.27  # m: beyond the fitted band, and among the free waves
AMPLITUDE = (4e-5, 1.2e-5)


class CorrugatedRail(Case):
    """One recording that depends on the free waves by a random matrix, on rail with this wave."""

    def __init__(self, wave=None, seed=11):
        rng = np.random.default_rng(seed)
        self.waves = Waves(PLACES, 0.0)
        self.predictor = SimpleNamespace(waves=self.waves)
        self.nuisances = tuple(self.waves.nuisances())
        self.columns = 0.1 * rng.normal(size=(400, len(self.nuisances))) / self.waves.sd
        x = np.arange(self.waves.start, self.waves.end, 0.01)
        path = np.zeros(x.size) if wave is None else wave.paths(None, None)[0](x)
        amplitudes = 0.01 * 2.0 / self.waves.length * self.waves.shapes(x) @ path
        amplitudes += self.waves.sd * rng.normal(size=amplitudes.size)
        data = self.columns @ amplitudes + rng.normal(size=400)
        self.observations = (Observation("a", "a", data, 1.0, data_type="passage"),)

    def predict(self, values, terms, observations):
        return [self.columns @ [values[n] for n in self.waves.names]]

    def nuisance_jacobian(self, values, terms, observations, base):
        return [self.columns]


def scan_of(case):
    return RailScan(case, fit_jointly(case, iterations=3))


def height_at(term, x):
    return term.paths(None, None)[0](x)


@pytest.mark.parametrize("phase", np.linspace(-3.0, 3.0, 5))
def test_the_phase_is_that_of_the_free_waves(phase):
    true = physics.RailCorrugation(*STRETCH, 5e-5 * np.cos(phase), 5e-5 * np.sin(phase), LENGTH, 2.5)
    wave = wave_in_band(scan_of(CorrugatedRail(true)), STRETCH, (1.01 * LENGTH, 0.025 * LENGTH), AMPLITUDE)
    x = np.arange(STRETCH[0] + 0.5, STRETCH[1] - 0.5, 0.01)
    found = physics.RailCorrugation(wave.start, STRETCH[1], wave.amplitude, 0.0, wave.wavelength, 2.5)
    assert np.corrcoef(height_at(found, x), height_at(true, x))[0, 1] > 0.8
    assert wave.gain > 10.0 and abs(wave.start - STRETCH[0]) <= 0.6 * LENGTH


def test_the_error_of_the_wavelength_is_that_of_all_probable_ones():
    """In the band: the true one is within two errors in 95 % of 40 (at least 34: four standard errors of n less).
    Outside it: the error of the level, as far as it is tried, two standard deviations to both sides."""
    inside, errors = 0, []
    for seed in range(40):
        phase = 0.157 * seed
        true = physics.RailCorrugation(*STRETCH, 5e-5 * np.cos(phase), 5e-5 * np.sin(phase), LENGTH, 2.5)
        wave = wave_in_band(scan_of(CorrugatedRail(true, seed)), STRETCH, (1.02 * LENGTH, 0.025 * LENGTH), AMPLITUDE)
        inside += abs(wave.wavelength - LENGTH) <= 2.0 * wave.wavelength_error
        errors.append(wave.wavelength_error)
    assert inside >= 34 and np.median(errors) < 0.5 * 0.025 * LENGTH
    short = wave_in_band(scan_of(CorrugatedRail(true)), STRETCH, (0.12, 0.003), AMPLITUDE)
    assert short.wavelength_error == pytest.approx(stats.truncnorm(-2.0, 2.0).std() * 0.003, rel=0.05)


def test_the_penalty_of_a_phase_is_at_most_that_of_the_number_of_phases():
    """It is above 0 and below the logarithm of the number of phases, and 0 for a wave outside the band."""
    true = physics.RailCorrugation(*STRETCH, 5e-5, 0.0, LENGTH, 2.5)
    for case in (CorrugatedRail(true), CorrugatedRail(None)):
        wave = wave_in_band(scan_of(case), STRETCH, (LENGTH, 0.025 * LENGTH), AMPLITUDE)
        assert 0.5 < wave.penalty <= np.log(16.0)
    short = wave_in_band(scan_of(CorrugatedRail(true)), STRETCH, (0.12, 0.003), AMPLITUDE)
    assert short.gain == pytest.approx(0.0, abs=0.05) and short.penalty == pytest.approx(0.0, abs=0.05)
    assert short.amplitude == pytest.approx(AMPLITUDE[0], rel=0.01)


def test_on_intact_rail_the_best_phase_less_its_penalty_is_rarely_evidence():
    """The mean of the likelihood ratio over all phases, amplitudes and wavelengths is 1 on such rail."""
    ratios = []
    for seed in range(60):
        scan = scan_of(CorrugatedRail(None, seed))
        ratios.append(np.exp(wave_in_band(scan, STRETCH, (LENGTH, 0.025 * LENGTH), AMPLITUDE).evidence))
    assert np.mean(ratios) < 2.0 and np.mean(np.array(ratios) > np.exp(3.0)) <= 0.05


def test_a_candidate_of_the_level_starts_in_phase_and_expects_the_evidence_in_its_band():
    """It competes with corrugation from the free waves alone, whose expected evidence is that of the band."""
    true = physics.RailCorrugation(20.5, 27.0, 1.5e-5, -2.5e-5, LENGTH)
    case = TrackCase(measured_campaign(small_plan((15.0,), hammer_positions=()), (true,), 7))
    fit = SimpleNamespace(candidates=(), values={n.name: n.mean for n in case.nuisances})
    x = np.arange(15.0, 33.0, 0.01)
    residual = height_at(true, x)
    scan = SimpleNamespace(
        x=x,
        score=lambda shapes: (1e9 * shapes @ residual, 1e9 * shapes @ shapes.T),
        waves_without=lambda shape: {"cos_wave_40": float(np.max(shape))},
    )
    (by_level,) = short_corrugation_candidates(case, fit)
    (found,) = short_corrugation_candidates(case, fit, scan)
    start = height_at(found.term(found.starts[0]), x)
    assert start @ residual > 0.7 * np.sqrt((start @ start) * (residual @ residual))
    assert found.refit.nuisances == {"cos_wave_40": pytest.approx(float(np.max(start)), rel=0.1)}
    gain = 1e9 * (start @ residual - 0.5 * start @ start)
    assert found.refit.promise - by_level.refit.promise == pytest.approx(gain, rel=0.1)
    assert by_level.site.n_scanned < found.site.n_scanned <= 16.0 * by_level.site.n_scanned
