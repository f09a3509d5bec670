"""Recordings of a campaign as observations of a case, with the reasons why some are rejected."""

from collections import Counter
from dataclasses import replace

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.turnout import passage_alignment, passage_observation, receptance_observation
from turnout.mismatch.turnout.disturbances import disturbances
from turnout.mismatch.turnout.passage_alignment import aligned, seated
from turnout.mismatch.turnout.wheel_roughness import wheel_modes
from turnout.simulate.sensor import Sensor

FAR = 8.0  # m from impact to sensor: beyond, the model error leaves 1/30 of the information
TIMED = 0.25  # correlation above which the time of a train is certain; at wrong times: 0.10


def hammer_observations(case):
    """Yield (name of the test, Observation) of every response channel with accepted impacts.

    Stores the pairs and notes in the case.
    """
    for test in case.campaign.hammer:
        sensors = [*case.campaign.sensors, *_loose(test, case.campaign.sensors)]
        sensors = [s for s in sensors if s.name not in case.ceilings and abs(s.place - test.place) <= FAR]
        pairs = receptance_observation.pairs_of(test, sensors, case.settings.pair_tolerance)
        if not pairs:
            case.notes.append(
                f"hammer test {test.name}: no channel within {FAR:g} m with {receptance_observation.FEWEST} sound blows"
            )
        for pair, observation in pairs:
            case.pairs[pair.name] = pair
            yield test.name, observation


def passage_observations(case):
    """Yield (name, Observation) of every passage that correlates with the simulation of its train.

    Stores the aligned passages and notes in the case.
    """
    if not case.campaign.passages:
        return
    values = {n.name: 0.0 for n in case.listed()} | case.start_values
    found = seated(case, values)
    case.start_values, values = {**case.start_values, **found}, {**values, **found}
    for passage in case.campaign.passages:
        sensors = case.campaign.sensors_of(passage)
        if not sensors:
            case.notes.append(f"passage {passage.name}: none of the sensors recorded it")
            continue
        try:
            reference, speed, likeness = aligned(case, values, passage)
        except SimulationError as error:
            case.notes.append(f"passage {passage.name}: cannot be simulated: {error}")
            continue
        if likeness < passage_alignment.ALIKE:
            case.unlike.append(passage)
            case.notes.append(
                f"passage {passage.name}: likeness {likeness:.2f} with the simulation of "
                f"{passage.train or 'its train'}; wrong vehicle file, wrong sensor places or another turnout"
            )
            if likeness > TIMED:
                case.strange[passage.name] = passage_observation.Rolling(
                    passage.name, passage, sensors, np.zeros(0), reference, speed
                )
            continue
        try:
            made, observation = passage_observation.rolling_of(
                passage, sensors, reference, speed, case.settings.materiality
            )
        except SimulationError as error:
            case.notes.append(f"passage {passage.name}: {error}")
            continue
        case.rollings[passage.name] = made
        yield passage.name, with_errors(case, {**values, **dict.fromkeys(_own_of(passage), 0.0)}, made, observation)


def with_errors(case, values, made, observation):
    """The observation with the error modes of its passage: track and wheels as ``values`` give them."""
    modes = (
        passage_observation.coupling_modes(made, observation.data).astype(np.float32),
        wheel_modes(case, values, made, observation.sigma),
    )
    return replace(observation, modes=np.column_stack(modes))


def undisturbed(case, found):
    """Recordings without the passages in which another source shakes the sensors.

    All of them where fewer than two would remain.
    """
    case.disturbed = tuple(disturbances(case.rollings, case.strange))
    shaken = {d.name: d for d in case.disturbed if d.name in case.rollings}
    if len(found) - len(shaken) < 2:
        return found
    for name, d in shaken.items():
        del case.rollings[name]
        case.notes.append(f"passage {name}: not used, {d.louder:.0f} dB louder {d.when} its train than the others")
    return [(name, o) for name, o in found if name not in shaken]


def foreign(case):
    """Trains of which more passages contradict their vehicle file than match it, from two passages on.

    Either another train came, or the trains of this type differ. Passages that were disturbed or could not be simulated
    do not count.
    """
    unlike = Counter(p.train for p in case.unlike if p.train)
    known = Counter(case.said(made)["train"] for made in case.rollings.values())
    shaken = {d.name for d in case.disturbed}
    left = {p.train for p in case.campaign.passages if p.name in shaken}
    return tuple(t for t, n in unlike.items() if known and n + known[t] > 1 and n > known[t] and t not in left)


def _own_of(passage):
    """Names of the nuisances of a passage."""
    return [n.name for n in passage_observation.rolling_nuisances(passage)]


def _loose(test, sensors):
    """Accelerometers of a hammer test that are no installed sensors."""
    known, found = {s.name for s in sensors}, {}
    for recording in test.recordings[:1]:
        for channel in recording.channels:
            if channel.quantity == "acceleration" and channel.name not in known and channel.position is not None:
                found[channel.name] = Sensor(channel.name, channel.position, channel.mounting)
    return found.values()
