"""The choice of recordings for a diagnosis: sections, trains, and the recordings reserved for verification."""

from types import SimpleNamespace

import pytest

from turnout.mismatch.turnout.campaign import PassageInput
from turnout.simulate import load_vehicle
from turnout.stages.mismatch_inputs import _is_unusable
from turnout.stages.mismatch_trains import train_of
from turnout.stages.recording_choice import reserved_names, select_passages, split_by_length


def train(name, kind, axles, speed):
    return SimpleNamespace(name=name, train=kind, vehicle=SimpleNamespace(wheels=range(axles)), speed=speed)


FLEET = [train(f"ic3 {k}", "ic3", 8, 30.0 + k) for k in range(9)]
FLEET += [train(f"intercity {k}", "intercity", 24, 40.0 + k) for k in range(3)] + [
    train("freight", "freight", 40, 25.0)
]


def test_every_type_is_chosen_and_short_trains_with_extreme_speeds_are_added():
    chosen = select_passages(FLEET, max_passages=8, max_axles=96)
    assert {p.train for p in chosen} == {"ic3", "intercity", "freight"}
    assert sum(len(p.vehicle.wheels) for p in chosen) <= 96
    ic3 = [p.speed for p in chosen if p.train == "ic3"]
    assert min(ic3) == 30.0 and max(ic3) == 38.0


def test_trains_of_one_type_and_two_lengths_are_two_trains():
    """The name of a type with a single length is not changed."""
    lengths = {"a": ("ic3", 8), "b": ("ic3", 12), "c": ("ic3", 8), "d": ("freight", 40), "e": ("", 4), "f": ("", 8)}
    fleet = [PassageInput(k, None, SimpleNamespace(wheels=range(n)), 30.0, kind) for k, (kind, n) in lengths.items()]
    found = {p.name: p.train for p in split_by_length(fleet)}
    assert found == {
        "a": "ic3, 8 axles", "b": "ic3, 12 axles", "c": "ic3, 8 axles", "d": "freight", "e": "", "f": "",
    }  # fmt: skip


def test_a_train_that_exceeds_the_limit_of_axles_is_chosen_if_it_is_the_only_one():
    assert select_passages(FLEET[-1:], max_axles=8) == FLEET[-1:]


def test_a_fifth_of_many_passages_and_none_of_few_is_reserved_at_medium_speeds():
    assert reserved_names(FLEET[:3], ()) == ()
    assert reserved_names(FLEET[:5], ()) == ("ic3 2",)
    assert reserved_names(FLEET[:9], ()) == ("ic3 2", "ic3 7")


def test_passages_are_chosen_from_the_types_in_turn():
    """The passages of both types are equally short, and not all are chosen from the first type."""
    fleet = [train(f"{kind} {k}", kind, 8, (30.0 if kind == "a" else 40.0) + k) for kind in "ab" for k in range(10)]
    chosen = select_passages(fleet, max_passages=8, max_axles=96)
    assert [p.name for p in chosen] == ["a 0", "a 1", "a 8", "a 9", "b 0", "b 1", "b 8", "b 9"]


def test_the_only_passage_of_a_train_is_not_reserved():
    """Fits need every train for its wheels; the passage with the nearest speed is reserved instead."""
    fleet = [train(f"a {k}", "a", 8, 30.0 + k) for k in range(7)]
    assert reserved_names([*fleet, train("b", "b", 8, 31.5)], ()) == (
        "a 1",
        "a 6",
    )  # b would be the third to be reserved
    two = [train("a 1", "a", 8, 30.0), train("a 2", "a", 8, 33.0)]
    others = [train(kind, kind, 8, 31.0 + k) for k, kind in enumerate("bc")]
    assert reserved_names([*two, *others], ()) == ("a 2",)
    assert reserved_names([train(kind, kind, 8, 30.0 + k) for k, kind in enumerate("abcde")], ()) == ("c",)


@pytest.mark.parametrize("reversed_train", [False, True])
def test_a_reversed_train_is_simulated_as_reversed(reversed_train, repository):
    """The locomotive pushes: axles, their order and loads are those of the reversed train, a separate train."""
    folder = repository / "config" / "vehicles"
    file = load_vehicle("intercity", 0.5, folder)
    places = file.wheel_positions[-1] - file.wheel_positions[::-1] if reversed_train else file.wheel_positions
    row = {"train_type": "intercity", "speed_kmh": 120.0, "n_axles": 24, "axle_times_s": 2.0 + places / 33.0}
    found = train_of(row, {}, folder)
    assert found.speed == pytest.approx(33.0)
    assert found.vehicle.wheel_positions == pytest.approx(places)
    assert found.vehicle.static_loads == pytest.approx(file.static_loads[:: -1 if reversed_train else 1])
    assert (found.name, any("other way" in d for d in found.doubts)) == (
        ("intercity reversed", True) if reversed_train else ("intercity", False)
    )


@pytest.mark.parametrize(
    "reason, share, is_unusable",
    [("clipped", 5e-4, False), ("clipped", 0.01, True), ("clipped", None, True), ("dead_channel", 0.0, True),
     ("no_train", None, False)],
)  # fmt: skip
def test_a_channel_with_a_few_clipped_impacts_is_used(reason, share, is_unusable):
    assert _is_unusable({"reason_code": reason, "measured_value": share}) == is_unusable
