"""Thirty train types of a public collection of axle geometry: each is recognized, and other trains are unknown."""

import re

import numpy as np
import pytest

from turnout.config.settings.passage import PassageSettings
from turnout.passage.axle_patterns import Group, Pattern, Vehicle, offsets
from turnout.passage.kinematics import Motion
from turnout.passage.train_type import find_type


def read_vehicle(path) -> Vehicle:
    """Vehicle of a key-and-value file, lengths in mm."""
    lines = (line.split(maxsplit=1) for line in path.read_text(encoding="utf-8").splitlines() if " " in line)
    values = {k: v for k, v in lines}
    length = float(values["LENGTH"])
    number = {k: float(v) for k, v in values.items() if k.startswith("DIST")}
    base = [number.get(f"DIST_WHEELS{i}", number.get("DIST_WHEELS", 0.0)) for i in (1, 2)]
    if "DIST_MIDDLES" in number:
        # distances of the bogie centres, the first from the front or the second from the back
        back = length - number["DIST_MIDDLES"] - number.get("DIST_BACK_TO_MID2", 0.0)
        first = number.get("DIST_FRONT_TO_MID1", back)
        front, second = first - base[0] / 2, first + number["DIST_MIDDLES"] - base[1] / 2
    else:
        front = number.get("DIST_FRONT_TO_WHEEL", number.get("DIST_WHEEL_TO_BACK"))
        second = front + base[0] + number["DIST_PAIR"]
    places = sorted({front, front + base[0], second, second + base[1]})
    return Vehicle(values["OFFICIAL_NAME"], length / 1e3, tuple(round(x / 1e3, 4) for x in places))


def read_train(path, vehicles) -> Pattern:
    """Pattern of a train: car(n) repeats, car[R] is turned round; "DB Avmz 801" means car 801."""
    order = re.search(r"^ORDER (.*)$", path.read_text(encoding="utf-8"), re.M)[1]
    row = []
    for item in order.split(","):
        name, turned, count = re.fullmatch(r"(.*?)(\[R\])?(?:\((\d+)\))?", item.strip()).groups()
        vehicle = vehicles[name if name in vehicles else name.split()[-1]]
        row += [vehicle.reverse() if turned else vehicle] * int(count or 1)
    return Pattern(path.stem, tuple(Group((v,)) for v in row))


@pytest.fixture(scope="module")
def collection(shared_data):
    folder = shared_data / "train_axle_geometry" / "data"
    if not folder.is_dir():
        pytest.skip("no collection of axle geometry")
    vehicles = {p.stem: read_vehicle(p) for p in sorted((folder / "cars").glob("*.txt"))}
    return [read_train(p, vehicles) for p in sorted((folder / "trains").glob("*.txt"))]


def passing_times(pattern, rng, place_error=0.03):
    """Axle times at one sensor: any speed, some acceleration, either direction, places off by 3 cm."""
    vehicles = pattern.fixed_row()[1]
    if rng.random() < 0.5:
        vehicles = tuple(v.reverse() for v in reversed(vehicles))
    motion = Motion(rng.uniform(12, 55), 1.0, rng.uniform(-0.15, 0.15))
    return motion.time(offsets(vehicles) + rng.normal(0, place_error, len(offsets(vehicles))))


def test_the_collection_has_thirty_types_with_the_number_of_axles_in_their_names(collection):
    assert len(collection) == 30
    for pattern in collection:
        stated_count = re.search(r"_(\d+)$", pattern.type)
        assert pattern.axle_counts() == (int(stated_count[1]),) * 2


def both_ways(patterns):
    return [p for pattern in patterns for p in (pattern, pattern.reverse())]


def family(pattern):
    """Rounded axle positions: types with the same positions to 5 cm cannot be distinguished and count as one."""
    return tuple(np.round(offsets(pattern.fixed_row()[1]) / 0.05).astype(int))


def test_each_type_is_recognized_and_a_type_without_a_template_is_unknown(collection):
    """30 types x 4 passages, speed unknown. At least 99 % named; without its own template at least 95 % unknown."""
    rng, settings = np.random.default_rng(20), PassageSettings()
    named = unknown = total = 0
    for pattern in collection:
        others = [p for p in collection if p is not pattern]
        for _ in range(4):
            times = passing_times(pattern, rng)
            total += 1
            named += find_type(times, both_ways(collection), settings, position_se=0.03).type == pattern.type
            unknown += find_type(times, both_ways(others), settings, position_se=0.03).type == "unknown"
    assert named >= 0.99 * total
    assert unknown >= 0.95 * total
