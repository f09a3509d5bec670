"""From raw files of several weeks to the weekly amplitude of the charts: stage, batch, registry and view."""

from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pytest
from benchmarks.passage_truth import IC3, PATTERNS, paper_model, rolling_noise

from turnout.config import load_configuration, with_raw
from turnout.readers.writing import write
from turnout.records import Channel
from turnout.registry.database import open_registry
from turnout.registry.job import register
from turnout.stages.passage import PassageContext, SectionModel, passage_unit
from turnout.workflow.batches import UnitResult, read_results, write_batch
from turnout.workflow.scan import scan

PLACES = {"OT": -12.0, "SP": 3.6, "CLP": 13.8, "A7": 24.6, "A8": 26.4, "A9": 28.2, "ASM": 36.0, "ASD": 36.0}
SILENT = ("A9", "ASD")  # on the other track
HEARD = [name for name in PLACES if name not in SILENT]
LOUDER, LOUD = 1.5, ("A7", "CLP")  # from the third week on, as without a rail pad; A7 has a model, CLP has none
FIRST = datetime(2024, 5, 6, 6)  # a Monday
TRAINS = (5, 6, 5, 5, 4)  # in each week: four are too few for an amplitude


def passing_train(rng, week):
    """An IC3 at 36 to 40 m/s; two sensors have ``LOUDER`` times the amplitude from the third week on."""
    recording = rolling_noise(rng, IC3, rng.uniform(36.0, 40.0), list(PLACES.values()), noise=0.01)
    samples = recording.samples.copy()
    for i, name in enumerate(PLACES):
        if name in SILENT:
            samples[i] = 0.003 * rng.standard_normal(samples.shape[1])
        elif name in LOUD and week >= 2:
            samples[i] *= LOUDER
    channels = tuple(Channel(name, "acceleration", x) for name, x in PLACES.items())
    return replace(recording, samples=samples, channels=channels)


@pytest.fixture(scope="module")
def chart_rows(tmp_path_factory, repository):
    """The rows of the weekly charts of a registry that was computed from raw files of several weeks."""
    root, rng = tmp_path_factory.mktemp("weeks"), np.random.default_rng(61)
    raw, folder = root / "raw", root / "raw" / "tommerup_s1" / "passages"
    folder.mkdir(parents=True)
    (root / "work").mkdir()
    for week, n in enumerate(TRAINS):
        for k in range(n):
            moment = FIRST + timedelta(days=7 * week, hours=29 * k)
            recording = replace(passing_train(rng, week), started_at=moment)
            write([recording], folder / f"{moment:%Y%m%dT%H%M%SZ}.h5", "hdf5")
    turnout = with_raw(load_configuration(repository / "config").turnout("tommerup_s1"), raw)
    quick = replace(turnout.settings["passage"], null_models=5)
    turnout = replace(turnout, settings={**turnout.settings, "passage": quick})
    models = {n: (SectionModel(f"m-{n}", FIRST, paper_model(place)),) for n, place in (("A7", "CP A7"), ("OT", "OT"))}
    results = []
    for unit in scan(turnout, raw).units:
        rows = passage_unit(unit, turnout, raw, PassageContext(models, PATTERNS))
        tables = {name: made for name, made in rows.items() if made}
        results.append(UnitResult(f"tommerup_s1/{unit.label}", "tommerup_s1", "passage", unit.label, "a", "ok", tables))
    register([write_batch(root / "work", results)], root / "registry", read=read_results)
    question = (
        "select section_id, measured_at_utc, frequency_hz, frequency_se_hz from chart_values "
        "where band = 'amplitude' and source = 'passage' order by section_id, measured_at_utc"
    )
    with open_registry(root / "registry") as connection:
        return connection.execute(question).fetchall()


def test_there_is_a_value_per_section_and_week_with_five_trains(chart_rows):
    weeks = [FIRST.replace(hour=0) + timedelta(days=7 * k) for k in range(4)]
    assert [(s, m) for s, m, *_ in chart_rows] == [(f"tommerup_s1/{n}", w) for n in sorted(HEARD) for w in weeks]


def test_charts_show_by_how_much_the_amplitude_of_two_sensors_rose_and_others_stay(chart_rows):
    for name in HEARD:
        truth = LOUDER if name in LOUD else 1.0
        rows = [(np.log(value), se / value) for section, _, value, se in chart_rows if section.endswith(name)]
        (before, error_before), (after, error_after) = (
            (np.mean([v for v, _ in part]), np.hypot(*(e for _, e in part)) / 2) for part in (rows[:2], rows[2:])
        )
        error = float(np.hypot(error_before, error_after))
        assert after - before == pytest.approx(np.log(truth), abs=4 * error)
        # 21 trains whose peaks scatter by some 10 %: known to a tenth
        assert error < 0.1
