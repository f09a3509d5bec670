"""Units in wide letters, with powers, prefixes apart, multiples, peak values and brackets of any kind."""

import numpy as np
import pytest

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription
from turnout.units import conversion

G = 9.80665
FORCE, RAIL = np.random.default_rng(3).normal(size=(2, 400)).round(4)
CHANNELS = (RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration"))
IN_SI = (RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration", "m/s²"))
FORCES = {
    "dyn": 1e-5, "gf": 1e-3 * G, "kg-f": G, "kgF": G, "tf": 1e3 * G, "lb": 4.4482216152605, "hN": 100.0, "10^3 N": 1e3,
    "10³ N": 1e3, "10**3 N": 1e3, "x10 N": 10.0, "×10 N": 10.0, "x 10³ N": 1e3, "1E3 N": 1e3, "N·10³": 1e3, "k N": 1e3,
    "da N": 10.0, "ｋＮ": 1e3, "Ｎ": 1.0, "［ｋＮ］": 1e3, "Dekanewton": 10.0, "KILONEWTONS": 1e3,
    "N pk": 1.0, "kN peak": 1e3, "Pounds": 4.4482216152605, "PoundForce": 4.4482216152605, "KilogramForce": G,
    "kilogram-force": G, "Kilopond": G,
}  # fmt: skip
ACCELERATIONS = {
    "µm/s²": 1e-6, "μm/s^2": 1e-6, "um/s2": 1e-6, "mm/s2": 1e-3, "mm·s⁻²": 1e-3, "mm s^-2": 1e-3, "mm/s**2": 1e-3,
    "cm s-2": 1e-2, "dm/s²": 0.1, "km/s2": 1e3, "nm/s²": 1e-9, "inch/s²": 0.0254, "ft/sec²": 0.3048, "m / s2": 1.0,
    "m per s²": 1.0, "meters per second squared": 1.0, "ｍ／ｓ²": 1.0, "㎨": 1.0, "gn": G, "g_n": G, "g0": G,
    "µg": 1e-6 * G, "g pk": G, "g peak": G, "gpk": G, "g (0-pk)": G, "m/s² pk": 1.0, "10^-2 m/s²": 1e-2,
    "（g）": G, "【m/s²】": 1.0, "MetersPerSecondSquared": 1.0, "MillimetersPerSecondSquared": 1e-3,
    "InchesPerSecondSquared": 0.0254, "FeetPerSecondSquared": 0.3048, "Meters/Second^2": 1.0, "m/(s*s)": 1.0,
    "m/sek²": 1.0, "Meter pro Sekunde²": 1.0, "m/s^{2}": 1.0, "mm/s^{2}": 1e-3, "Gs": G,
}  # fmt: skip


@pytest.mark.parametrize(("unit", "scale"), [*FORCES.items(), *ACCELERATIONS.items()])
def test_a_unit_is_known_in_any_form(unit, scale):
    of_unit = conversion(unit)
    assert of_unit.dimension == ("force" if unit in FORCES else "acceleration")
    assert of_unit.scale == pytest.approx(scale, rel=1e-12)


@pytest.mark.parametrize("unit", ["t", "kg", "ms2", "m/s²²", "N*10", "KN", "MV", "g pk pk", "10^N", "x N", "m/s-2"])
def test_what_is_no_unit_or_may_be_two_stays_unknown(unit):
    with pytest.raises(ValueError, match="not known"):
        conversion(unit)


def outcome(tmp_path, name, channels):
    try:
        result = read(name, tmp_path, RawDescription(channels, rate=5000.0))
    except ReadError as error:
        return error
    return result.errors[0] if result.errors else result.recordings[0].samples


AVERAGED = ["g rms", "gRMS", "m/s² (rms)", "g pk-pk", "m/s² eff", "mVpp", "g mean"]


@pytest.mark.parametrize("channels", [CHANNELS, IN_SI])
@pytest.mark.parametrize("unit", AVERAGED)
def test_values_over_a_stretch_of_time_are_no_samples(unit, channels, tmp_path):
    rows = "".join(f"{f};{a}\n" for f, a in zip(FORCE, RAIL))
    (tmp_path / "a.csv").write_text(f"force;rail\n[N];[{unit}]\n{rows}", "utf-8")
    error = outcome(tmp_path, "a.csv", channels)
    assert error.reason == "unit_unknown" and "over a stretch of time" in error.problem


@pytest.mark.parametrize(
    "name", [f"rail [{unit}]" for unit in AVERAGED if "(" not in unit] + ["rail（g）", "rail【mg】", "rail [ｍｇ]"]
)
def test_brackets_of_any_kind_in_a_name_are_compared_with_the_layout(name, tmp_path):
    np.savez(tmp_path / "a.npz", **{"force": FORCE, name: RAIL})
    channels = IN_SI[0], RawChannel("rail", name, "acceleration", "m/s²")
    assert outcome(tmp_path, "a.npz", channels).reason == "unit_unknown"


@pytest.mark.parametrize("name", ["force 10^3 N", "force [10³ N]", "force ×10³ [N]", "force 10**3 [N]", "force_10^3_N"])
def test_a_power_of_ten_in_a_name_is_not_ignored(name, tmp_path):
    np.savez(tmp_path / "a.npz", **{name: FORCE, "rail": RAIL})
    channels = RawChannel("force", name, "force", "N"), IN_SI[1]
    assert outcome(tmp_path, "a.npz", channels).reason == "scale_unknown"


@pytest.mark.parametrize("brackets", ["[]", "()", "{}", "<>", "（）", "［］", "【】", "〔〕", "⟨⟩"])
@pytest.mark.parametrize("is_in_names", [True, False])
def test_brackets_of_any_kind_hold_the_unit_of_a_column(brackets, is_in_names, tmp_path):
    units = [f"{brackets[0]}{unit}{brackets[1]}" for unit in ("kN", "g")]
    head = f"force{units[0]};rail {units[1]}" if is_in_names else f"force;rail\n{';'.join(units)}"
    rows = "".join(f"{f};{a}\n" for f, a in zip(FORCE, RAIL))
    (tmp_path / "a.csv").write_text(f"{head}\n{rows}", "utf-8")
    np.testing.assert_allclose(outcome(tmp_path, "a.csv", CHANNELS), [FORCE * 1e3, RAIL * G])


@pytest.mark.parametrize("unit", ["0^-3 N", "1e99^99 N", "2^3 N", "10^-99^9 N", "0 N", "1e999 N", "0**-1 m/s²"])
def test_a_multiple_that_is_no_power_of_ten_is_an_unknown_unit(unit):
    with pytest.raises(ValueError, match="is not known"):
        conversion(unit)


@pytest.mark.parametrize("place", ["supp", "opp", "Klapp", "left mean", "links eff"])
def test_a_place_in_the_name_of_a_channel_is_no_mark_of_root_mean_squares(place, tmp_path):
    name = f"force {{{place}}}"
    rows = "".join(f"{f};{a}\n" for f, a in zip(FORCE, RAIL))
    (tmp_path / "a.csv").write_text(f"{name};rail\n{rows}", "utf-8")
    channels = RawChannel("force", name, "force", "N"), IN_SI[1]
    np.testing.assert_allclose(outcome(tmp_path, "a.csv", channels), [FORCE, RAIL])
    with pytest.raises(ValueError, match="known are"):
        conversion(place)
