"""The public interface of ``import turnout``: names, reference page, the example of the README, errors and texts."""

import ast
import inspect
import re
import subprocess
import sys
import warnings
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

import turnout
from turnout.api import reference_page
from turnout.api.diagnosis import TurnoutFindings
from turnout.api.hammer import Impacts
from turnout.config.settings.simulate import SimulateSettings
from turnout.errors import ConfigError, ConfigErrors, ReadError, RegistryError, SimulationError
from turnout.readers.writing import write
from turnout.records import Channel, LongRecording, ModalModel, RawChannel, Recording, Rejection
from turnout.simulate import Sensor, car, uniform_track

MAX_REPR = 240  # characters: about two lines of a notebook
SECTIONS = ("Parameters", "Returns", "Raises", "Examples")


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    """Folder with the file of the example, and the variables after its lines have run."""
    folder = tmp_path_factory.mktemp("example")
    reference_page.write_example_file(folder / "OT_1.uff")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv("MPLBACKEND", "Agg")
        variables: dict = {}
        exec(reference_page.EXAMPLE, variables)
    return folder, variables


def pair(n=200, **fields):
    """A recording of force and acceleration."""
    samples = np.random.default_rng(4).normal(size=(2, n))
    return Recording(samples, 1e3, (Channel("hammer", "force"), Channel("rail", "acceleration")), **fields)


# Names


def test_importing_turnout_loads_no_other_module():
    code = "import sys, turnout; print([m for m in sys.modules if m.split('.')[0] in ('numpy', 'typing', 'matplotlib') "
    code += "or m.startswith('turnout.')])"
    output = subprocess.run([sys.executable, "-S", "-c", f"import sys; sys.path[:0] = {sys.path!r}\n{code}"],
                            capture_output=True, text=True, check=True).stdout  # fmt: skip
    assert output.strip() == "[]"


def test_names_reference_page_and_type_stubs_agree(repository):
    page = (repository / "docs" / "api.md").read_text(encoding="utf-8")
    on_page = re.findall(r"^### turnout\.(\w+)$", page, re.MULTILINE)
    tree = ast.parse((repository / "src" / "turnout" / "__init__.py").read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    for_editors = {alias.name: node.module for node in block.body for alias in node.names}
    assert (
        sorted(on_page) == turnout.__all__ == sorted(name for names in reference_page.GROUPS.values() for name in names)
    )
    assert for_editors == turnout._MODULE_OF
    assert set(turnout.__all__) <= set(dir(turnout))


def test_the_reference_page_is_up_to_date_with_the_docstrings(repository):
    assert (repository / "docs" / "api.md").read_text(encoding="utf-8") == reference_page.page()


@pytest.mark.parametrize("name", turnout.__all__)
def test_every_function_describes_parameters_results_errors_and_has_an_example(name):
    function = getattr(turnout, name)
    text = inspect.getdoc(function)
    assert all(f"\n{section}\n{'-' * len(section)}\n" in text for section in SECTIONS)
    parameters = text.split("Parameters\n----------\n")[1].split("\nReturns\n")[0]
    described = {n for line in re.findall(r"^(\w.*?) : ", parameters, re.MULTILINE) for n in line.split(", ")}
    assert described == set(inspect.signature(function).parameters)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="'turnout' has no attribute 'identify'"):
        turnout.identify  # noqa: B018


def test_the_function_receptance_stays_callable_after_an_import_of_the_former_package():
    code = """
import turnout
for line in ("from turnout.receptance.estimators import h1", "from turnout.receptance import find_impacts"):
    try:
        exec(line)
    except ImportError as error:
        assert "renamed" in str(error), error
    else:
        raise SystemExit(f"no error: {line}")
assert callable(turnout.receptance)
"""
    subprocess.run([sys.executable, "-c", code], check=True)


# Five lines


def test_the_readme_and_the_page_show_the_five_lines_that_are_run(repository):
    for page in ("README.md", "docs/api.md"):
        assert f"```python\n{reference_page.EXAMPLE}\n```" in (repository / page).read_text(encoding="utf-8")
    assert len([line for line in reference_page.EXAMPLE.splitlines() if line]) == 5


def test_the_five_lines_compute_modes_with_standard_errors_and_a_figure_from_a_file(example, repository):
    folder, variables = example
    model, impacts = variables["model"], variables["impacts"]
    assert model.status == "accepted" and [mode.band for mode in model.modes] == ["ballast", "railpad"]
    assert all(mode.frequency_low < mode.frequency < mode.frequency_high for mode in model.modes)
    assert all(0.0 < mode.frequency_se < 0.02 * mode.frequency for mode in model.modes)
    assert len(impacts.usable) == len(impacts) == 10
    assert (folder / "modes.png").read_bytes()[:4] == b"\x89PNG"
    readme = (repository / "README.md").read_text(encoding="utf-8")
    assert f">>> impacts\n{impacts!r}\n" in readme
    printed = readme.split(">>> model\n")[1].split("\n")[0]
    number = r"\d+(?:\.\d+)?"
    assert re.sub(number, "#", printed) == re.sub(number, "#", repr(model))
    values, expected = ([float(n) for n in re.findall(number, text)] for text in (printed, repr(model)))
    assert values == pytest.approx(expected, abs=1.0)  # Hz: the last digits differ from processor to processor


def test_the_command_of_the_readme_writes_the_file_of_the_five_lines(example, repository, tmp_path):
    readme = (repository / "README.md").read_text(encoding="utf-8")
    words = re.search(r"a simulated file to try: `python (-m .*?)`", readme)[1].split()
    subprocess.run([sys.executable, *words], cwd=tmp_path, check=True)
    assert (tmp_path / "OT_1.uff").read_bytes() == (example[0] / "OT_1.uff").read_bytes()


def test_the_modes_equal_those_of_the_nightly_run(example):
    from turnout.config.settings.identify import IdentifySettings
    from turnout.hammer_test import find_impacts, receptance_of
    from turnout.modal import identify

    variables = example[1]
    impacts = find_impacts(variables["recordings"].recordings, "hammer", "acc_1")
    reference = identify([i.decay for i in impacts], impacts[0].rate, IdentifySettings(), receptance_of(impacts))
    assert variables["model"].modes == reference.modes


def test_axes_have_units_and_the_figure_shows_every_impact(example):
    model = example[1]["model"]
    receptance, ballast, railpad = model.plot()
    assert receptance.get_xlabel() == "frequency [Hz]" and receptance.get_ylabel() == "receptance [m/N]"
    assert ballast.get_ylabel() == "damping ratio [%]" and railpad.get_xlabel() == "frequency [Hz]"
    (curve,) = (line for line in receptance.get_lines() if line.get_label() == "modes of the fit")
    np.testing.assert_allclose(curve.get_ydata(), np.abs(model.fitted_receptance.at(curve.get_xdata())))
    means = [line for line in railpad.get_lines() if len(line.get_xdata()) == 1]
    impacts = [line for line in railpad.get_lines() if len(line.get_xdata()) == 10]
    mode = model.mode("railpad")
    assert any(line.get_xdata()[0] == mode.frequency and line.get_ydata()[0] == 100 * mode.damping for line in means)
    assert impacts and receptance.get_xscale() == receptance.get_yscale() == "log"


def test_the_plot_of_a_receptance_has_its_coherence_and_that_of_a_recording_its_channels(example):
    variables = example[1]
    magnitude, coherence = turnout.receptance(variables["impacts"]).plot()
    assert magnitude.get_ylabel() == "receptance [m/N]" and coherence.get_ylabel() == "coherence [-]"
    force, acceleration = variables["recordings"][0].plot()
    assert (force.get_ylabel(), acceleration.get_ylabel()) == ("force [N]", "acceleration [m/s²]")
    assert acceleration.get_xlabel() == "time [s]"


def test_plots_are_drawn_into_a_given_figure(example):
    from matplotlib.figure import Figure

    figure = Figure(layout="constrained")
    upper, lower = figure.subfigures(2, 1)
    axes = [*example[1]["model"].plot(upper), *example[1]["recordings"][0].plot(lower)]
    assert len(axes) == 5 and all(one.get_figure(root=True) is figure for one in axes)


def test_the_plot_of_a_model_without_modes_states_the_reason():
    model = turnout.identify_modes(turnout.find_impacts(pair()))
    assert model.status == "rejected" and repr(model).endswith(
        "0 of 1 impacts accepted, 3 needed; rejected for no_impact)"
    )
    (axes,) = model.plot()
    assert "3 needed" in axes.texts[0].get_text()


# Texts


def test_the_repr_of_every_result_is_one_line(example, repository):
    variables = example[1]
    model, impacts, recordings = (variables[name] for name in ("model", "impacts", "recordings"))
    many = Recording(np.zeros((9, 10)), 1e3, tuple(Channel(f"sensor_{k}", "acceleration") for k in range(9)), "passage")
    long = LongRecording(lambda start, stop: np.zeros((1, stop - start)), 10**9, 2e4, (Channel("A7", "acceleration"),))
    findings = TurnoutFindings("t1", {"mismatch_findings": [
        {"sections": "A7+A8", "verdict": "a_or_b", "term": "hanging_sleeper", "probability": 0.9, "sentence": "..."},
    ], "quarantine": [{}]})  # fmt: skip
    results = [model, impacts, impacts[0], recordings, recordings[0], many, long, turnout.receptance(impacts), findings]
    configuration = turnout.load_configuration(repository / "config")
    track, vehicle = turnout.load_track("tommerup"), turnout.load_vehicle("ic3")
    results += [*model.modes, configuration, configuration.turnout("tommerup_s1"), track, track.track, vehicle]
    for result in results:
        assert len(repr(result)) < MAX_REPR and "\n" not in repr(result), repr(result)
    assert repr(findings) == "TurnoutFindings(t1: A7+A8 a or b hanging_sleeper (0.90); 1 without answer)"
    assert findings.frame().loc[0, "sections"] == "A7+A8" and findings.sentences == ("sections A7+A8: ...",)


def test_the_repr_of_a_rejected_impact_states_the_reason():
    impacts = turnout.find_impacts([pair(), pair()])
    assert isinstance(impacts, Impacts) and impacts.usable == ()
    assert repr(impacts) == "Impacts(2: 0 accepted, 2 rejected: impact 1 no_impact, 2 no_impact)"
    assert repr(impacts[0]) == "Impact(record 1, rejected: no_impact)"


def test_the_repr_of_a_model_with_one_mode_states_what_is_missing():
    empty = np.zeros(0)
    reason = Rejection("not_identified", detail="ballast band holds no stable mode")
    model = ModalModel(np.zeros((0, 0)), empty, empty, 1e3, (), status="second_order_only", rejections=(reason,))
    assert repr(model) == "ModalModel(joint, second_order_only: ballast band holds no stable mode)"


# Read


def test_a_file_without_units_needs_a_description_of_its_channels(tmp_path):
    path = tmp_path / "test.npz"
    np.savez(path, hammer=np.array([0.0, 1.0, 0.0]), rail=np.array([0.0, 2.0, 1.0]), fs=1000.0)
    with pytest.raises(
        ReadError, match=r"test\.npz, channel 'hammer': the file states no unit\. Describe it: channels="
    ):
        turnout.read(path)
    hammer = {"quantity": "force", "unit": "V", "sensitivity": 0.5, "sensitivity_unit": "mV/N", "sign": -1}
    recording = turnout.read(path, channels={"hammer": hammer, "rail": "acceleration"})[0]
    assert recording.kind == "hammer" and recording.rate == 1000.0
    np.testing.assert_array_equal(recording.samples, [[0.0, -2000.0, 0.0], [0.0, 2.0, 1.0]])


@pytest.mark.parametrize("names", [("Beschleunigung", "Kraft"), ("accelerometer 3", "rail")])
def test_a_channel_whose_unit_and_name_disagree_needs_a_description(tmp_path, names):
    path = tmp_path / "test.npz"
    np.savez(path, **dict(zip(names, np.eye(2, 3))), fs=1000.0, units=np.array(["N", "m/s²"]), channels=np.array(names))
    with pytest.raises(ReadError, match=f"channel '{names[0]}': its unit 'N' is one of force, and its name says accel"):
        turnout.read(path)
    assert turnout.read(path, channels=dict(zip(names, ("force", "acceleration"))), kind="passage").recordings


def test_the_error_of_a_channel_with_complex_numbers_states_what_it_contains(tmp_path):
    path = tmp_path / "test.npz"
    np.savez(path, force=np.arange(100) + 1j, rail=np.random.default_rng(1).normal(size=100), fs=1000.0)
    with pytest.raises(ReadError, match=r"test\.npz, the channels: the channel 'force' holds complex numbers"):
        turnout.read(path, channels={"force": "force", "rail": "acceleration"})


def test_only_the_channels_that_differ_need_a_description(tmp_path):
    recording = pair()
    write([recording], tmp_path / "a.h5", "hdf5")
    inverted = RawChannel("rail", "rail", "acceleration", sign=-1, position=3.0)
    described = turnout.read(tmp_path / "a.h5", channels={"rail": inverted})[0]
    np.testing.assert_allclose(described.samples, recording.samples * [[1.0], [-1.0]], rtol=1e-12, atol=0)
    assert described.channels[1].position == 3.0
    only_rail = turnout.read(tmp_path / "a.h5", channels={"hammer": "ignored"})[0]
    assert [c.name for c in only_rail.channels] == ["rail"] and only_rail.kind == "passage"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"channels": {"hamer": "force"}}, "the channels: there is no channel 'hamer'; there are 'hammer', 'rail'"),
        ({"rate": 2000.0}, "Hz"),
        ({"format": "tdms"}, r"a\.h5"),
    ],
)
def test_an_option_that_contradicts_the_file_is_a_read_error_with_the_path_as_given(
    tmp_path, monkeypatch, options, message
):
    write([pair()], tmp_path / "a.h5", "hdf5")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ReadError, match=message) as caught:
        turnout.read("a.h5", **options)
    assert caught.value.path == "a.h5" and caught.value.where and caught.value.problem and caught.value.remedy


def test_a_missing_file_is_a_read_error(tmp_path):
    with pytest.raises(ReadError, match=r"nothing\.uff, the path: there is no such file"):
        turnout.read(tmp_path / "nothing.uff")


def test_a_damaged_record_gives_a_warning_and_the_others_are_read(tmp_path):
    path = write([pair(record=k) for k in range(3)], tmp_path / "a.uff", "uff58b")
    path.write_bytes(path.read_bytes()[:-500])
    with pytest.warns(UserWarning, match=r"a\.uff, record 3"):
        result = turnout.read(path)
    assert len(result) == 2 and len(result.errors) == 1 and "1 damaged" in repr(result)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        turnout.read(write([pair()], tmp_path / "b.uff", "uff58b"))


def test_a_file_of_damaged_records_alone_is_an_error(tmp_path):
    path = write([pair()], tmp_path / "a.uff", "uff58b")
    path.write_bytes(path.read_bytes()[:-500])
    with pytest.raises(ReadError, match=r"a\.uff"):
        turnout.read(path)


def test_a_layout_describes_the_files_of_its_sections(tmp_path, repository):
    layout = repository / "config" / "layouts" / "tommerup.yaml"
    samples = np.random.default_rng(1).normal(size=(2, 3000))
    channels = Channel("force", "force"), Channel("rail", "acceleration")
    recordings = [Recording(samples * (k + 1), 2e4, channels, record=k) for k in range(10)]
    path = write(recordings, tmp_path / "A7_1.h5", "hdf5")
    result = turnout.read(path, layout=layout, section="A7")
    assert [r.n_sample for r in result] == [3000] * 10 and result[0].channels[1].position == 24.6
    turnout_s1 = turnout.load_configuration(repository / "config").turnout("tommerup_s1")
    assert turnout.read(path, layout=turnout_s1, section="A7")[9].channels == result[9].channels
    with pytest.raises(ReadError, match="there is no channel"):
        turnout.read(path, layout=layout)  # passage files have other channels
    with pytest.raises(ConfigError, match=r"tommerup\.yaml, section: there is no section 'X9'\. Write one of OT, SP"):
        turnout.read(path, layout=layout, section="X9")
    with pytest.raises(ConfigError, match=r"none\.yaml, the path: there is no such file"):
        turnout.read(path, layout=tmp_path / "none.yaml", section="A7")
    with pytest.raises(ValueError, match="either a layout or channels"):
        turnout.read(path, layout=layout, section="A7", channels={"rail": "acceleration"})


def test_errors_of_a_layout_name_line_and_column(tmp_path):
    (tmp_path / "layouts").mkdir()
    (tmp_path / "layouts" / "mine.yaml").write_text("sections:\n  A: {panel: OT, track: both, positon: 1.0}\n")
    with pytest.raises(ConfigErrors, match=r"layouts/mine\.yaml, line 2, column \d+"):
        turnout.read("any.uff", layout=tmp_path / "layouts" / "mine.yaml", section="A")


# Hammer tests


def test_spikes_in_a_hammer_test_are_replaced_and_a_warning_states_them(caplog):
    rng, t = np.random.default_rng(1), np.arange(2000) / 10_000.0
    force = 500.0 * np.sin(np.pi * (t - 0.01) / 2e-3) * ((t > 0.01) & (t < 0.012))
    acceleration = np.exp(-80.0 * (t - 0.01)) * np.sin(900.0 * (t - 0.01)) * (t > 0.01)
    samples = np.stack([force, acceleration]) + rng.normal(size=(2, 2000)) * [[0.1], [1e-3]]
    channels = Channel("hammer", "force"), Channel("rail", "acceleration")
    expected = turnout.find_impacts(Recording(samples, 1e4, channels))
    assert len(expected.usable) == 1 and not caplog.text
    spoilt = samples.copy()
    spoilt[0, 1200] = 900.0
    (impact,) = turnout.find_impacts(Recording(spoilt, 1e4, channels, source="OT_1.uff"))
    # the replaced sample of noise is part of the offset that is subtracted
    assert impact.accepted and impact.impulse == pytest.approx(expected[0].impulse, rel=1e-3)
    assert "OT_1.uff, record 1: hammer: 1 sample replaced, the first at 0.120 s" in caplog.text


def test_the_caller_must_choose_one_of_several_channels():
    samples = np.zeros((3, 50))
    channels = Channel("hammer", "force"), Channel("acc_1", "acceleration"), Channel("acc_2", "acceleration")
    recording = Recording(samples, 1e3, channels)
    with pytest.raises(ValueError, match="several channels of acceleration: say response= one of acc_1, acc_2"):
        turnout.find_impacts(recording)
    assert len(turnout.find_impacts(recording, response="acc_2")) == 1
    with pytest.raises(ValueError, match=r"has no channel of force; it has acc_1 \(acceleration\)"):
        turnout.find_impacts(Recording(samples[:1], 1e3, channels[1:2]))
    with pytest.raises(ValueError, match="no recording"):
        turnout.find_impacts([])


def test_the_method_is_one_of_two(example):
    impacts = example[1]["impacts"]
    assert turnout.identify_modes(impacts, method="paper").method == "paper"
    with pytest.raises(ValueError, match="no method 'era'"):
        turnout.identify_modes(impacts, method="era")


# Simulation and passages


def test_a_simulated_passage_is_analysed_by_positions_alone():
    settings = SimulateSettings(lead=0.4, tail=0.4)
    sensors = [Sensor(name, x, noise=0.05) for name, x in (("A", 30.0), ("B", 36.0), ("C", 45.0))]
    recording = turnout.simulate_passage(uniform_track(75.0), car(), 40.0, sensors=sensors, seed=2, settings=settings,
                                         started_at=datetime(2024, 5, 13))  # fmt: skip
    passage = turnout.analyse_passage(recording, patterns=())
    assert passage.n_axle == 4 and passage.direction == "facing"
    assert passage.speed.speed == pytest.approx(40.0, abs=4 * passage.speed.se)
    assert len(repr(passage)) < MAX_REPR and "4 axles" in repr(passage) and "km/h" in repr(passage)


def test_a_passage_needs_positions_and_one_train():
    with pytest.raises(ValueError, match="no accelerometer of the recording has a position"):
        turnout.analyse_passage(pair())
    hour = Recording(np.zeros((1, 3600)), 1.0, (Channel("A7", "acceleration", 1.0),), "passage")
    with pytest.raises(ValueError, match="lasts 3600 s, more than 180 s"):
        turnout.analyse_passage(hour)


def test_a_simulated_hammer_test_follows_the_settings():
    settings = SimulateSettings(rate=10e3, hammer_duration=0.05, hammer_half_length=6.0)
    (recording,) = turnout.simulate_hammer(uniform_track(30.0), 15.0, impacts=1, settings=settings)
    assert recording.rate == 10e3 and recording.n_sample == 500
    with pytest.raises(SimulationError, match="no section 'X9' in the track file"):
        turnout.simulate_hammer("tommerup", "X9")


def test_accepted_effects_of_a_track_file_change_the_simulation(tmp_path, repository):
    tracks = repository / "config" / "tracks"
    heavy = tmp_path / "heavy.yaml"
    heavy.write_text(
        "extends: tommerup\nterms:\n"
        "  - {term: hanging_sleeper, sleeper: -12.0, gap: {value: 3, unit: mm, source: test}}\n"
    )
    settings = SimulateSettings(hammer_half_length=8.0, hammer_duration=0.04)
    plain, hanging = (
        turnout.simulate_hammer(turnout.load_track(path, folder=tracks), "OT", impacts=1, settings=settings)[0]
        for path in ("tommerup", heavy)
    )
    difference = np.abs(plain.signal("acc_1") - hanging.signal("acc_1")).max()
    assert difference > 0.02 * np.abs(plain.signal("acc_1")).max()


# Diagnosis and registry


def test_a_turnout_is_diagnosed_from_its_configuration(monkeypatch, repository):
    calls = []
    rows = {"mismatch_findings": [], "quarantine": []}
    monkeypatch.setattr(
        "turnout.stages.mismatch_results.diagnose_turnout", lambda *arguments: calls.append(arguments) or rows
    )
    configuration = turnout.load_configuration(repository / "config")
    findings = turnout.diagnose("tommerup_s1", configuration=configuration, visit="2024-05", sections=["A7"])
    assert calls == [("tommerup_s1", str(repository / "config"), "raw", "work", "2024-05", None, ("A7",))]
    assert repr(findings) == "TurnoutFindings(tommerup_s1: no section)"


def test_a_turnout_has_the_settings_of_its_configuration(repository):
    from turnout.config.settings.mismatch import MismatchSettings

    with pytest.raises(ValueError, match="settings of its configuration"):
        turnout.diagnose("tommerup_s1", MismatchSettings())
    with pytest.raises(ConfigError, match=r"turnouts\.tsv, line 1, column 1: no turnout 'nowhere'"):
        turnout.diagnose("nowhere", configuration=repository / "config")


@pytest.fixture(scope="module")
def registry_folder(tmp_path_factory):
    from turnout.registry.job import register

    root = tmp_path_factory.mktemp("registry") / "registry"
    register([], root, read=iter)
    return root


def test_a_registry_returns_data_frames_and_is_read_only(registry_folder):
    with turnout.open_registry(registry_folder) as registry:
        assert {"recordings", "modes", "worklist"} <= set(registry.tables)
        assert registry.sql("select ? + 1 as n", [2]).loc[0, "n"] == 3
        assert list(registry.sql("from modes").columns)[:2] == ["model_id", "band"]
        assert len(repr(registry)) < MAX_REPR and "tables and views, no measurement" in repr(registry)
        with pytest.raises(RegistryError, match="read-only"):
            registry.sql("create table mine (n integer)")
        with pytest.raises(RegistryError, match=r"'tables' names the tables and views"):
            registry.sql("from no_such_table")
    assert repr(registry) == f"Registry({registry_folder}, closed)"


def test_a_folder_without_a_registry_is_an_error(tmp_path):
    with pytest.raises(RegistryError, match="there is no registry here"):
        turnout.open_registry(tmp_path)


def test_the_package_of_the_public_names_does_not_compute():
    """The functions call those of other packages: no module imports numpy."""
    folder = Path(inspect.getfile(Impacts)).parent
    for path in folder.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            assert not (isinstance(node, ast.Import) and any(alias.name == "numpy" for alias in node.names)), path


@pytest.mark.parametrize("call", [turnout.receptance, turnout.identify_modes, turnout.diagnose])
def test_the_error_of_a_wrong_type_of_argument_states_the_type_that_is_needed(call):
    recording = Recording(np.zeros((1, 10)), 1e3, (Channel("A7", "acceleration"),))
    with pytest.raises(TypeError, match=r"impacts, as turnout\.find_impacts gives them|the id of a turnout"):
        call([recording])
    with pytest.raises(TypeError, match=r"recordings, as turnout\.read gives them"):
        turnout.find_impacts(["OT_1.uff"])
