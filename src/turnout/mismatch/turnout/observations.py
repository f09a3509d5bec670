"""Recordings of a campaign as observations of a case, with the reasons why some are rejected."""

from collections import Counter
from dataclasses import replace

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.turnout import passage_alignment, passage_observation, receptance_observation
from turnout.mismatch.turnout.disturbances import disturbances
from turnout.mismatch.turnout.passage_alignment import align_with_simulation, fit_surface
from turnout.mismatch.turnout.wheel_roughness import wheel_modes
from turnout.simulate.sensor import Sensor

MAX_HAMMER_DISTANCE = 8.0  # m from impact to sensor: beyond, the model error leaves 1/30 of the information
MIN_TIMED_CORRELATION = 0.25  # correlation above which the time of a train is certain; at wrong times: 0.10


def hammer_observations(case):
    """Yield (name of the test, Observation) of every response channel with accepted impacts.

    Stores the pairs and notes in the case.
    """
    for test in case.campaign.hammer:
        sensors = [*case.campaign.sensors, *_loose_sensors(test, case.campaign.sensors)]
        sensors = [
            s for s in sensors if s.name not in case.saturated and abs(s.place - test.place) <= MAX_HAMMER_DISTANCE
        ]
        pairs = receptance_observation.pairs_of_test(test, sensors, case.settings.pair_tolerance)
        if not pairs:
            case.notes.append(
                f"hammer test {test.name}: no channel within {MAX_HAMMER_DISTANCE:g} m with "
                f"{receptance_observation.MIN_IMPACTS} sound blows"
            )
        for pair, observation in pairs:
            case.frf_pairs[pair.name] = pair
            yield test.name, observation


def passage_observations(case):
    """Yield (name, Observation) of every passage that correlates with the simulation of its train.

    Stores the aligned passages and notes in the case.
    """
    if not case.campaign.passages:
        return
    values = {n.name: 0.0 for n in case.all_nuisances()} | case.start_values
    surface_values = fit_surface(case, values)
    case.start_values, values = {**case.start_values, **surface_values}, {**values, **surface_values}
    for passage in case.campaign.passages:
        sensors = case.campaign.sensors_of(passage)
        if not sensors:
            case.notes.append(f"passage {passage.name}: none of the sensors recorded it")
            continue
        try:
            reference, speed, correlation = align_with_simulation(case, values, passage)
        except SimulationError as error:
            case.notes.append(f"passage {passage.name}: cannot be simulated: {error}")
            continue
        if correlation < passage_alignment.MIN_CORRELATION:
            case.unmatched.append(passage)
            case.notes.append(
                f"passage {passage.name}: likeness {correlation:.2f} with the simulation of "
                f"{passage.train or 'its train'}; wrong vehicle file, wrong sensor places or another turnout"
            )
            if correlation > MIN_TIMED_CORRELATION:
                case.unmatched_aligned[passage.name] = passage_observation.AlignedPassage(
                    passage.name, passage, sensors, np.zeros(0), reference, speed
                )
            continue
        try:
            aligned, observation = passage_observation.observe_passage(
                passage, sensors, reference, speed, case.settings.materiality
            )
        except SimulationError as error:
            case.notes.append(f"passage {passage.name}: {error}")
            continue
        case.aligned_passages[passage.name] = aligned
        yield (
            passage.name,
            with_errors(case, {**values, **dict.fromkeys(_nuisance_names(passage), 0.0)}, aligned, observation),
        )


def with_errors(case, values, aligned, observation):
    """The observation with the error modes of its passage: track and wheels as ``values`` give them."""
    modes = (
        passage_observation.coupling_modes(aligned, observation.data).astype(np.float32),
        wheel_modes(case, values, aligned, observation.sigma),
    )
    return replace(observation, modes=np.column_stack(modes))


def without_disturbed(case, recordings):
    """Recordings without the passages in which another source shakes the sensors.

    All of them where fewer than two would remain.
    """
    case.disturbed_recordings = tuple(disturbances(case.aligned_passages, case.unmatched_aligned))
    disturbed = {d.name: d for d in case.disturbed_recordings if d.name in case.aligned_passages}
    if len(recordings) - len(disturbed) < 2:
        return recordings
    for name, d in disturbed.items():
        del case.aligned_passages[name]
        case.notes.append(f"passage {name}: not used, {d.excess:.0f} dB louder {d.when} its train than the others")
    return [(name, o) for name, o in recordings if name not in disturbed]


def mismatched_trains(case):
    """Trains of which more passages contradict their vehicle file than match it, from two passages on.

    Either another train came, or the trains of this type differ. Passages that were disturbed or could not be simulated
    do not count.
    """
    unmatched = Counter(p.train for p in case.unmatched if p.train)
    matched = Counter(case.conditions_of(aligned)["train"] for aligned in case.aligned_passages.values())
    disturbed_names = {d.name for d in case.disturbed_recordings}
    disturbed_trains = {p.train for p in case.campaign.passages if p.name in disturbed_names}
    return tuple(
        t
        for t, n in unmatched.items()
        if matched and n + matched[t] > 1 and n > matched[t] and t not in disturbed_trains
    )


def _nuisance_names(passage):
    """Names of the nuisances of a passage."""
    return [n.name for n in passage_observation.passage_nuisances(passage)]


def _loose_sensors(test, sensors):
    """Accelerometers of a hammer test that are no installed sensors."""
    installed, accelerometers = {s.name for s in sensors}, {}
    for recording in test.recordings[:1]:
        for channel in recording.channels:
            if channel.quantity == "acceleration" and channel.name not in installed and channel.position is not None:
                accelerometers[channel.name] = Sensor(channel.name, channel.position, channel.mounting)
    return accelerometers.values()
