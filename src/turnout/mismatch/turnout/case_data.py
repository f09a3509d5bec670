"""What a case of a turnout is made of: the observations of a campaign, its site, and what is not used."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from turnout.config.settings.mismatch import MismatchSettings
from turnout.errors import SimulationError
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout.amplitude_scale import wrong_scale
from turnout.mismatch.turnout.campaign import CampaignInput, PassageInput
from turnout.mismatch.turnout.channel_identity import exchanged_channels
from turnout.mismatch.turnout.common_delay import common_delay
from turnout.mismatch.turnout.deviating_tests import deviating_tests
from turnout.mismatch.turnout.disturbances import Disturbance
from turnout.mismatch.turnout.filed_tests import FiledTests
from turnout.mismatch.turnout.impact_positions import misplaced_tests
from turnout.mismatch.turnout.layout_fault import LayoutFault
from turnout.mismatch.turnout.observed_passages import observe_passages
from turnout.mismatch.turnout.observed_tests import HammerStart, fit_hammer_start, observe_tests
from turnout.mismatch.turnout.passage_model import Track1D
from turnout.mismatch.turnout.passage_observation import AlignedPassage
from turnout.mismatch.turnout.prediction import Predictor
from turnout.mismatch.turnout.receptance_observation import FrfPair
from turnout.mismatch.turnout.saturation import SaturationLimit, raw_peak, saturated_channels, without_saturated
from turnout.mismatch.turnout.site import Site, site_of
from turnout.mismatch.turnout.support_positions import misplaced_supports


@dataclass(frozen=True)
class CaseData:
    """What a case is made of; nothing of it changes in a diagnosis.

    Attributes
    ----------
    campaign : CampaignInput
        Without the saturated sensors.
    settings : MismatchSettings
    site : Site
        The track about sensors and impacts as filed, with its nuisances.
    frf_pairs : mapping
        Response channels of the hammer tests, by name.
    aligned_passages : mapping
        Passages that are used, by name.
    observations, reserved : tuple of Observation
        Those that are fitted, and those that no fit uses.
    start_values : mapping
        Nuisances of track, sensors and running surface where fits start.
    saturated : mapping
        Sensor -> estimated limit of its channel, for sensors that are not used.
    unmatched : tuple of PassageInput
        Passages that do not correlate with the simulation of their train.
    disturbed : tuple of Disturbance
        Passages in which another source shakes the sensors.
    notes : tuple of str
        What is not used, and why.
    layout_faults : tuple of LayoutFault
        Channels and impacts that are not where the layout states, and wrong units, as corrected in the campaign.
    """

    campaign: CampaignInput
    settings: MismatchSettings
    site: Site
    frf_pairs: Mapping[str, FrfPair]
    aligned_passages: Mapping[str, AlignedPassage]
    observations: tuple[Observation, ...]
    reserved: tuple[Observation, ...] = ()
    start_values: Mapping[str, float] = field(default_factory=dict)
    saturated: Mapping[str, SaturationLimit] = field(default_factory=dict)
    unmatched: tuple[PassageInput, ...] = ()
    disturbed: tuple[Disturbance, ...] = ()
    notes: tuple[str, ...] = ()
    layout_faults: tuple[LayoutFault, ...] = ()

    @property
    def mismatched_trains(self) -> tuple[str, ...]:
        """Trains of which more passages contradict their vehicle file than match it, from two passages on.

        Either another train came, or the trains of this type differ. Passages that were disturbed or could not be
        simulated do not count.
        """
        unmatched = Counter([*(p.train for p in self.unmatched if p.train), *self.campaign.contradicted_trains])
        matched = Counter(aligned.conditions["train"] for aligned in self.aligned_passages.values())
        disturbed_names = {d.name for d in self.disturbed}
        disturbed_trains = {p.train for p in self.campaign.passages if p.name in disturbed_names}
        return tuple(
            t
            for t, n in unmatched.items()
            if matched and n + matched[t] > 1 and n > matched[t] and t not in disturbed_trains
        )

    @property
    def no_train_matches(self) -> bool:
        """Whether several passages were recorded, and none correlates with the simulation of its train.

        A single one may be of another train.
        """
        return len(self.unmatched) > 1 and not self.aligned_passages

    @property
    def measured_range(self) -> tuple[float, float]:
        """First and last position of sensors and impacts [m]."""
        positions = self.campaign.positions()
        return min(positions), max(positions)

    def band_peak(self, channel: str) -> float:
        """Largest value of a channel in the fitted passages, within their band; 0 where it has none. [m/s²]

        Parameters
        ----------
        channel : str
            Name of a channel.

        Returns
        -------
        float
        """
        peaks = [0.0]
        for o in self.observations:
            aligned = self.aligned_passages.get(o.name)
            names = [s.name for s in aligned.sensors] if aligned else []
            if channel in names:
                peaks.append(float(np.max(np.abs(o.data.reshape(len(names), -1)[names.index(channel)]))))
        return max(peaks)

    def raw_peak(self, channel: str) -> float:
        """Largest value of a channel at its full sampling rate, reserved recordings included. [m/s²]

        A planned campaign has no such signals: its ``band_peak``.

        Parameters
        ----------
        channel : str
            Name of a channel.

        Returns
        -------
        float
        """
        return raw_peak(self.campaign, channel) or self.band_peak(channel)


def case_data(
    campaign: CampaignInput,
    settings: MismatchSettings,
    solver: Track1D,
    corrected: tuple[LayoutFault, ...] = (),
) -> tuple[CaseData, Predictor]:
    """Observations of a campaign, and the predictor of its recordings.

    Channels, impacts and supports that are not where the files state, and wrong units, are corrected first, if track
    and sensors then fit the hammer tests better. On the fitted rail passages are simulated, to align the recorded ones
    and to compute their errors.

    Parameters
    ----------
    campaign : CampaignInput
    settings : MismatchSettings
    solver : Track1D
        Settings of the simulation of passages.
    corrected : tuple of LayoutFault
        Faults that have been corrected in the campaign.

    Returns
    -------
    data : CaseData
    predictor : Predictor
        With the rail that the hammer tests give.

    Raises
    ------
    SimulationError
        No recording can be used, or all of them are reserved.
    """
    fitted, corrected = _correct_tests(_fit_tests(campaign, settings, solver), settings, solver, corrected)
    site, tests, start_values = fitted.filed.predictor.site, fitted.start.tests, fitted.start.values
    predictor = fitted.start.predictor.recentre(start_values)
    passages = observe_passages(
        fitted.campaign, settings.materiality, predictor, start_values, fitted.filed.upright_channels
    )
    for fault in passages.layout_faults:
        if _is_new(fault, corrected):
            return case_data(fault.correct(fitted.recorded), settings, solver, (*corrected, fault))
    recordings = [*tests.observations, *passages.observations]
    notes = (*tests.notes, *passages.notes)
    if not recordings:
        raise SimulationError("nothing to diagnose: " + "; ".join(notes))
    data = CaseData(
        fitted.campaign,
        settings,
        site,
        tests.frf_pairs,
        passages.aligned,
        tuple(o for name, o in recordings if name not in fitted.campaign.reserved),
        tuple(o for name, o in recordings if name in fitted.campaign.reserved),
        {**start_values, **passages.surface_values},
        fitted.saturated,
        passages.unmatched,
        passages.disturbed,
        notes,
        corrected,
    )
    if not data.observations:
        raise SimulationError("every recording is reserved for the verification: nothing is left to fit.")
    return data, predictor.with_recordings(data.frf_pairs, data.aligned_passages)


@dataclass(frozen=True)
class _FittedTests:
    """Hammer tests of a ``campaign`` without its saturated channels: compared with the file, and fitted.

    ``recorded`` is the campaign with all of its channels.
    """

    recorded: CampaignInput
    campaign: CampaignInput
    saturated: Mapping[str, SaturationLimit]
    filed: FiledTests
    start: HammerStart

    def is_better_than(self, reference: _FittedTests) -> bool:
        """Whether track and sensors fit these tests better; True where no test is fitted."""
        cost, reference_cost = self.start.mean_cost, reference.start.mean_cost
        return cost is None or reference_cost is None or cost < reference_cost


def _fit_tests(recorded: CampaignInput, settings: MismatchSettings, solver: Track1D) -> _FittedTests:
    saturated = saturated_channels(recorded, settings.threshold)
    campaign = without_saturated(recorded, saturated)
    tests = observe_tests(campaign, settings.pair_tolerance, saturated)
    predictor = Predictor(site_of(campaign), solver).with_recordings(tests.frf_pairs, {})
    filed = FiledTests(predictor, tests, tuple(test.place for test in campaign.hammer))
    start = fit_hammer_start(predictor, tests, campaign.reserved)
    return _FittedTests(recorded, campaign, saturated, filed, start)


def _is_new(fault: LayoutFault, corrected: Sequence[LayoutFault]) -> bool:
    """Whether there is a fault, of a kind that has not been corrected."""
    return bool(fault) and fault.recording_type not in {known.recording_type for known in corrected}


def _correct_tests(
    fitted: _FittedTests, settings: MismatchSettings, solver: Track1D, corrected: tuple[LayoutFault, ...]
) -> tuple[_FittedTests, tuple[LayoutFault, ...]]:
    """The tests without their faults, and all faults that have been corrected."""
    for fault in _faults_of_tests(fitted):
        if _is_new(fault, corrected):
            changed = _fit_tests(fault.correct(fitted.recorded), settings, solver)
            if changed.is_better_than(fitted):
                return _correct_tests(changed, settings, solver, (*corrected, fault))
    return fitted, corrected


def _faults_of_tests(fitted: _FittedTests) -> Iterator[LayoutFault]:
    """What every check of hammer tests finds, in the order in which faults are corrected."""
    filed = fitted.filed
    yield common_delay(filed)
    yield misplaced_tests(filed)
    yield exchanged_channels("hammer tests", filed.comparisons)
    yield wrong_scale("hammer tests", filed.comparisons)
    yield deviating_tests(list(filed.pairs_by_test), filed.comparisons)
    yield misplaced_supports(fitted.start, fitted.campaign.reserved)
