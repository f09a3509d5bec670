"""Supports elsewhere than in the track file: simulated tests on one track, diagnosed with the file of another."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal

from turnout.config.settings.mismatch import MismatchSettings
from turnout.errors import SimulationError
from turnout.mismatch.turnout.case_data import case_data
from turnout.mismatch.turnout.passage_model import Track1D
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan
from turnout.mismatch.turnout.support_positions import MisplacedSupports, _OffsetFits
from turnout.mismatch.turnout.zone import zone_of
from turnout.simulate.blade import Blade
from turnout.simulate.turnout_track import TurnoutTrack


@pytest.fixture(scope="module")
def campaign():
    return measured_campaign(small_plan((15.0,), passages=False))


def data_of(campaign):
    return case_data(campaign, MismatchSettings(), Track1D())[0]


def with_file_off(campaign, distance):
    """The campaign with a track file whose supports are ``distance`` further along the track than the true ones."""
    return replace(campaign, turnout=campaign.turnout.with_moved_supports(distance))


def with_resonant_mounting(campaign, name, frequency, quality):
    r"""The response of a mass on a spring and damper: (:math:`2 \zeta \omega_0 s + \omega_0^2`) over its polynomial."""
    omega = 2.0 * np.pi * frequency

    def change(recording):
        b, a = signal.bilinear([omega / quality, omega**2], [1.0, omega / quality, omega**2], recording.rate)
        samples = recording.samples.copy()
        for row in recording.of_quantity("acceleration"):
            if recording.channels[row].name == name:
                samples[row] = signal.lfilter(b, a, samples[row])
        return replace(recording, samples=samples)

    return campaign.with_recordings("hammer tests", change)


@pytest.mark.parametrize("distance", [0.1, 0.2, -0.15, 0.28])
def test_the_supports_are_taken_where_they_are(campaign, distance):
    data = data_of(with_file_off(campaign, distance))
    (fault,) = data.layout_faults
    # the same a bay further; 3 cm: one and a half standard deviations of the prior of a sensor's position
    assert min(abs(fault.offset + distance + k * 0.6) for k in (-1, 0, 1)) <= 0.03
    (sentence,) = fault.sentences()
    size = 100 * abs(fault.offset)
    # 1.96 times 2 cm to either side; three positions of impacts at one temperature
    assert f" {size:.0f} cm ({size - 3.92:.0f} to {size + 3.92:.0f}, 95 %, 3 tests) " in sentence
    assert f"by {fault.offset:+.2f} m" in sentence
    moved = data.site.nominal.turnout.track.support
    beside = (moved - campaign.turnout.track.support[0] + 0.3) % 0.6 - 0.3
    np.testing.assert_allclose(beside, beside[0], atol=1e-9)
    assert abs(beside[0]) <= 0.03


@pytest.mark.parametrize("distance", [0.0, 0.02, -0.03])
def test_supports_at_their_place_stay_there(campaign, distance):
    assert data_of(with_file_off(campaign, distance)).layout_faults == ()


def test_the_channel_that_gains_most_does_not_count():
    """Squares of the residuals before and after: 9 and 0, 4 and 1, 1 and 0. Without the first 3 + 1 are left."""
    observations = [("test", SimpleNamespace(name=channel)) for channel in "ABC"]
    pairs = {channel: SimpleNamespace(channel=channel) for channel in "ABC"}
    tests = SimpleNamespace(frf_pairs=pairs, observations=observations)
    fits = _OffsetFits(SimpleNamespace(predictor=None, values={}, tests=tests), ())
    white = {0.0: (3.0, 2.0, 1.0), 0.1: (0.0, 1.0, 0.0)}
    for offset, cost in ((0.0, 20.0), (0.1, 7.0)):
        residuals = [np.array([x]) for x in white[offset]]
        fits.fits[offset] = SimpleNamespace(cost=cost, white=residuals, scale={"hammer": 1.0})
    assert fits.gain(0.1) == pytest.approx(0.5 * (3.0 + 1.0))


@pytest.mark.parametrize(("other_costs", "is_shown"), [((60.0, 30.0), True), ((60.0, 59.0), False)])
def test_fits_without_the_channel_that_gains_most_must_show_it_too(monkeypatch, other_costs, is_shown):
    """A resonant mounting distorts the fit of all channels: together they gain, and the others alone nothing.
    An opened crossing with one at 313 Hz had its supports 17 cm elsewhere. 6 nats are asked."""
    observations = [("test", SimpleNamespace(name=channel)) for channel in "ABC"]
    tests = SimpleNamespace(frf_pairs={c: SimpleNamespace(channel=c) for c in "ABC"}, observations=observations)
    fits = _OffsetFits(SimpleNamespace(predictor=None, values={}, tests=tests), ())
    residuals = {0.0: {"A": 30.0, "B": 9.0, "C": 9.0}, 0.1: {"A": 5.0, "B": 4.0, "C": 4.0}}

    def fit(self, offset):
        names = [o.name for o in self.observations]
        costs = {0.0: 200.0, 0.1: 100.0} if "A" in names else dict(zip((0.0, 0.1), other_costs))
        white = [np.array([residuals[offset][name]]) for name in names]
        return SimpleNamespace(cost=costs[offset], white=white, scale={"hammer": 1.0})

    monkeypatch.setattr(_OffsetFits, "fit", fit)
    assert fits.gain(0.1) == pytest.approx(50.0)  # half the fall of the cost: the others' residuals fall by more
    assert fits.is_shown_by_others(0.1) == is_shown


@pytest.mark.parametrize(("frequency", "quality"), [(150.0, 8.0), (180.0, 6.6)])
def test_a_fault_of_one_channel_moves_no_support(campaign, frequency, quality):
    faulty = with_resonant_mounting(campaign, campaign.sensors[0].name, frequency, quality)
    assert MisplacedSupports not in {type(fault) for fault in data_of(faulty).layout_faults}


@pytest.mark.parametrize(("pad", "ballast", "damping"), [(1.6, 0.6, 1.0), (1.6, 1.6, 2.5), (0.6, 1.6, 1.0)])
def test_track_with_other_values_than_filed_is_no_fault_of_the_layout(campaign, pad, ballast, damping):
    """Two standard deviations of the priors. Compared with the file alone, a delay and a wrong scale explain them."""
    track = campaign.turnout.track
    filed = replace(
        track,
        pad_stiffness=pad * track.pad_stiffness,
        ballast_stiffness=ballast * track.ballast_stiffness,
        pad_damping=damping * track.pad_damping,
        ballast_damping=damping * track.ballast_damping,
    )
    assert data_of(replace(campaign, turnout=replace(campaign.turnout, track=filed))).layout_faults == ()


def test_only_the_supports_move(campaign):
    turnout = campaign.turnout
    moved = turnout.with_moved_supports(0.125)
    np.testing.assert_allclose(moved.track.support, turnout.track.support + 0.125, atol=1e-12)
    assert moved.track.stretches == turnout.track.stretches and moved.locations == turnout.locations
    assert moved.routes == turnout.routes


@pytest.mark.parametrize("offset", [0.3, -0.3])
@pytest.mark.parametrize(("toe", "heel", "end"), [(20.1, 25.2, 47.9), (27.9, 22.8, 0.2)])
def test_a_blade_that_ends_with_the_zone_ends_with_its_moved_supports(campaign, toe, heel, end, offset):
    """Behind the zone of a hammer test nothing is modelled: there blade and rail have one node in common."""
    turnout, rail = campaign.turnout, campaign.turnout.track.rail
    track = turnout.track.with_(blade=Blade(toe, heel, end, rail, 3e8, 3e4))
    turnout = zone_of(replace(turnout, track=track, tracks={"branch": track}), campaign.positions()).turnout
    moved = turnout.with_moved_supports(offset)
    for changed in (moved.track, moved.track_of("branch")):
        np.testing.assert_allclose(changed.support, turnout.track.support + offset, atol=1e-12)
        assert (changed.blade.toe, changed.blade.heel) == (toe, heel)
        assert changed.blade.end == pytest.approx(changed.end if end > toe else changed.start, abs=1e-9)


def test_a_blade_never_ends_before_its_heel(campaign):
    track = campaign.turnout.track
    blade = Blade(20.1, 30.0, 30.0, track.rail, 3e8, 3e4)
    moved = replace(campaign.turnout, track=track.with_(blade=blade)).with_moved_supports(-0.2)
    assert moved.track.blade == blade


def test_no_support_is_elsewhere_where_that_cannot_be_simulated(campaign, monkeypatch):
    """As with the toe of a blade that would be outside its track."""
    tried = []

    def fail(turnout, offset):
        tried.append(offset)
        raise SimulationError("the toe is not on the track")

    distant = with_file_off(campaign, 0.2)
    monkeypatch.setattr(TurnoutTrack, "with_moved_supports", fail)
    assert data_of(distant).layout_faults == () and tried
