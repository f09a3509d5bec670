"""Scales that a file states as an equation, and a scale of TDMS that npTDMS does not apply."""

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter
from test_readers_notations_of_starts import LAYOUT, NOISE, WRITERS

from turnout.readers import read

EQUATIONS = ["y=0.5x+0", "y = 2.5 x - 3", "f(x)=0.25x+1", "raw·0.5", "0.5⋅counts", "N = 0.5 · raw"]


@pytest.mark.parametrize("write", WRITERS)
@pytest.mark.parametrize("equation", EQUATIONS)
def test_an_equation_of_a_scale_is_reported(write, equation, tmp_path):
    write(tmp_path / "a", "conv" if write is WRITERS[1] else "Equation", equation)
    (path,) = tmp_path.iterdir()
    assert read(path.name, tmp_path, LAYOUT).errors


@pytest.mark.parametrize("text", ["1x+0", "mount x+", "y-z", "sleeper 3-x"])
def test_a_text_that_is_no_equation_is_not_reported(text, tmp_path):
    WRITERS[0](tmp_path / "a", "Equation", text)
    result = read("a.csv", tmp_path, LAYOUT)
    assert (len(result.recordings), result.errors) == (1, ())


def tdms_of(tmp_path, samples, kinds):
    scale = {"NI_Number_Of_Scales": len(kinds), "NI_Scaling_Status": "unscaled"}
    for i, kind in enumerate(kinds):
        source = {f"NI_Scale[{i}]_{kind}_Input_Source": i - 1 if i else 0xFFFFFFFF, f"NI_Scale[{i}]_Scale_Type": kind}
        scale |= source
        if kind == "Linear":
            scale |= {f"NI_Scale[{i}]_Linear_Slope": 0.5, f"NI_Scale[{i}]_Linear_Y_Intercept": 0.0}
    step = {"wf_increment": 5e-5}
    with TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        force = ChannelObject("G", "force", samples, step | scale)
        writer.write_segment([force, ChannelObject("G", "rail", NOISE[1], step)])
    return read("a.tdms", tmp_path, LAYOUT)


@pytest.mark.parametrize("type_of_numbers", ["int16", "int32", "uint16"])
def test_whole_numbers_under_a_scale_that_is_not_applied_are_rejected(type_of_numbers, tmp_path):
    samples = np.round(1000 * np.abs(NOISE[0])).astype(type_of_numbers)
    (error,) = tdms_of(tmp_path, samples, ["AdvancedAPI"]).errors
    assert "states the scale 'AdvancedAPI', which npTDMS cannot apply" in error.problem


def test_other_numbers_and_a_linear_scale_behind_it_are_read(tmp_path):
    (recording,) = tdms_of(tmp_path, NOISE[0], ["AdvancedAPI"]).recordings
    np.testing.assert_array_equal(recording.signal("force"), NOISE[0])
    samples = np.round(1000 * NOISE[0]).astype("int16")
    (recording,) = tdms_of(tmp_path, samples, ["AdvancedAPI", "Linear"]).recordings
    np.testing.assert_allclose(recording.signal("force"), 0.5 * samples)
