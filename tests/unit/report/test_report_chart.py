"""Charts draw values at the right pixels, which are computed by hand from the margins."""

import re
from datetime import UTC, datetime
from xml.etree import ElementTree

import numpy as np
import pytest

from turnout.report.axis import Axis, linear_ticks, log_ticks, time_ticks
from turnout.report.panels.hammer import HammerTest, coherence_panel, receptance_panel
from turnout.report.panels.history import DAMPING, history_panel
from turnout.report.panels.phase import phase_panel
from turnout.report.path_data import reduce_points
from turnout.report.svg import BOTTOM, LEFT, LETTER, RIGHT, TOP, Chart


def chart(scale="linear"):
    return Chart(Axis(10.0, 1000.0, "f [Hz]", scale), Axis(0.0, 4.0, "y"), "A <title> & more", width=476, height=266)


def test_the_corners_of_the_data_are_the_corners_of_the_frame():
    c = chart()
    assert c.px([10.0, 1000.0]) == pytest.approx([LEFT, 476 - RIGHT])
    assert c.py([0.0, 4.0]) == pytest.approx([266 - BOTTOM, TOP])


def test_the_geometric_mean_is_in_the_middle_of_a_logarithmic_axis():
    c = chart("log")
    assert float(c.px(100.0)) == pytest.approx((LEFT + 476 - RIGHT) / 2)


def test_a_missing_value_interrupts_the_line():
    c = chart()
    c.line([10.0, 200.0, 400.0, 1000.0], [1.0, np.nan, 2.0, 3.0], "curve")
    assert c.elements[0].count("M") == 2 and c.elements[0].count("l") == 2


def test_shaded_intervals_are_one_path_within_the_frame():
    """An interval of 800 to 2000 Hz on an axis to 1000 Hz ends at the frame; an interval outside is not drawn."""
    c = chart()
    c.span(np.array([10.0, 800.0, 1200.0]), np.array([208.0, 2000.0, 1400.0]), "gated", "left out")
    (element,) = c.elements
    starts = re.findall(r"M([\d.]+) (\d+)h([\d.]+)v(\d+)h-([\d.]+)z", element)
    ends = [end for x, _, w, _, _ in starts for end in (float(x), float(x) + float(w))]
    assert ends == pytest.approx([LEFT, LEFT + 80.0, LEFT + 400.0 * 790 / 990, 476 - RIGHT], abs=0.011)
    assert all(w == back and float(h) == 266 - TOP - BOTTOM for _, _, w, h, back in starts)
    assert "<title>left out</title>" in element
    c.span(5.0, 9.0, "gated")
    assert len(c.elements) == 1


def test_dots_of_a_series_are_one_group():
    c = chart()
    c.points([10.0, 500.0, np.nan], [0.0, 4.0, 1.0], "point", labels=["a", "b", "c"], series="campaign")
    dot = '<circle class="point" r="3" cx="{}" cy="{}"><title>{}</title></circle>'
    first, second = dot.format(LEFT, 266 - BOTTOM, "a"), dot.format(f"{LEFT + 400 * 490 / 990:.2f}", TOP, "b")
    assert c.elements == [f'<g data-series="campaign">{first}{second}</g>']


def test_a_band_with_a_missing_value_is_drawn_in_two_pieces():
    c = chart()
    c.band([10, 200, 400, 600, 1000], [1, 1, np.nan, 1, 1], [2, 2, 2, 2, 2], "interval")
    assert len(c.elements) == 2


def test_error_bars_span_low_to_high():
    c = chart()
    c.points([500.0], [2.0], "point", low=[1.0], high=[3.0])
    bottom, top = (float(v) for v in re.search(r'M[\d.]+ ([\d.]+)V([\d.]+)"', c.elements[0]).groups())
    assert (bottom, top) == pytest.approx((float(c.py(1.0)), float(c.py(3.0))), abs=0.05)


def test_the_drawing_is_valid_xml_with_escaped_text():
    c = chart("log")
    c.line([10, 100], [1, 2], "curve", 'say "<this>"')
    c.vertical(100.0, "event", "pads & clips")
    c.text(0.5, 0.5, "<b>")
    root = ElementTree.fromstring(c.svg().replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" ', 1))
    assert root.attrib["aria-label"] == "A <title> & more"
    assert any(t.text == "pads & clips" for t in root.iter("{http://www.w3.org/2000/svg}text"))


def test_the_axis_of_a_constant_quantity_has_a_width_above_zero():
    axis = Axis(5.0, 5.0)
    assert axis.low < 5.0 < axis.high


@pytest.mark.parametrize("low,high", [(0.0, 1e-9), (98.2, 103.9), (-7.0, 13.0), (1e6, 1.0001e6)])
def test_ticks_are_inside_the_axis_and_evenly_spaced(low, high):
    ticks = linear_ticks(low, high)
    steps = np.diff(ticks)
    # ticks are rounded to 12 decimals, which bounds both errors
    assert min(ticks) >= low - 1e-12 and max(ticks) <= high + 1e-12
    assert 2 <= len(ticks) <= 12 and np.ptp(steps) <= 2e-12 + 1e-9 * steps[0]


@pytest.mark.parametrize(("low", "high"), [(530.0, 530.00005), (-1e-3, 1e-3), (123456.0, 123460.0), (1e-9, 1.0004e-9)])
def test_no_two_ticks_have_the_same_text(low, high):
    """Each text, read as a number, equals its tick to a tenth of the step."""
    ticks = Axis(low, high).ticks()
    texts = [text for _, text in ticks]
    assert len(ticks) >= 3 and len(set(texts)) == len(texts)
    back = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
    read = []
    for text in texts:
        mantissa, _, power = text.rpartition("10" if set(text) & set("⁰¹²³⁴⁵⁶⁷⁸⁹") else "\0")
        read.append(float(mantissa.rstrip("·") or 1) * 10.0 ** int(power.translate(back)) if _ else float(text))
    assert read == pytest.approx([v for v, _ in ticks], abs=0.1 * (ticks[1][0] - ticks[0][0]))


def test_logarithmic_ticks_are_one_two_five():
    assert all(str(int(t / 10 ** np.floor(np.log10(t)) + 0.5)) in "125" for t in log_ticks(30.0, 1600.0))


@pytest.mark.parametrize("days", [40, 200, 1100, 3700])
def test_time_ticks_are_at_most_nine_first_days_of_months(days):
    start = 1.7e9
    ticks = time_ticks(start, start + 86400 * days)
    dates = np.array(ticks).astype("int64").astype("datetime64[s]")
    assert (dates == dates.astype("datetime64[M]")).all() and 1 <= len(ticks) <= 9


def test_a_long_curve_keeps_every_peak_with_at_most_four_points_per_pixel():
    px = np.linspace(0.0, 99.99, 20_000)
    py = np.sin(px) + 0.01 * np.cos(7000.0 * px)
    py[[1234, 15_000]] = 5.0, -5.0
    x, y = reduce_points(px, py)
    assert len(x) <= 400 and {5.0, -5.0} <= set(y) and (np.diff(x) > 0).all()
    for pixel in range(100):
        before, after = py[np.floor(px) == pixel], y[np.floor(x) == pixel]
        assert (before.min(), before.max()) == (after.min(), after.max())


def test_a_short_curve_and_a_curve_that_turns_back_keep_all_points():
    assert len(reduce_points(np.arange(10.0), np.arange(10.0))[0]) == 10
    back = np.concatenate([np.linspace(0, 1, 500), np.linspace(1, 0, 500)])
    assert len(reduce_points(back, back)[0]) == 1000


@pytest.mark.parametrize(("decay", "is_stated"), [(None, False), (0.0, False), (25.0, True)])
def test_the_panel_states_the_exponential_window_of_a_receptance(decay, is_stated):
    n = 40
    row = dict.fromkeys(("h1_real_m_n", "h1_imag_m_n", "h2_abs_m_n"), np.full(n, 1e-9)) | {
        "frequency_hz": np.linspace(0.0, 1000.0, n), "passed": np.ones(n, dtype=bool), "n_impacts": 7,
        "valid_to_hz": None, "window_decay_per_s": decay,
    }  # fmt: skip
    assert ("exp(-25/s t)" in receptance_panel(HammerTest(row, {}, [], []))) is is_stated


@pytest.mark.parametrize(("required", "drawn_at"), [(0.9, "M62 40.59l386 0"), (None, "")])
def test_the_limit_of_the_coherence_is_that_of_the_settings(required, drawn_at):
    """0.9 on an axis to 1.02 in a panel of 190: 150 - 124 * 0.9 / 1.02. Rows of earlier versions have no limit."""
    n = 40
    row = dict.fromkeys(("coherence", "coherence_low", "coherence_high"), np.full(n, 0.95)) | {
        "frequency_hz": np.linspace(20.0, 1600.0, n), "passed": np.ones(n, dtype=bool), "n_impacts": 7,
        "valid_to_hz": None, "gate": "limit", "gate_required": required,
    }  # fmt: skip
    svg = coherence_panel(HammerTest(row, {}, [], []))
    limits = re.findall(r'<path class="limit" data-series="[^"]*" d="([^"]*)"><title>required ([\d.]+)', svg)
    assert limits == ([(drawn_at, "0.9")] if required else [])


def test_a_time_axis_of_two_days_has_a_date():
    noon = datetime(2026, 5, 13, 12, tzinfo=UTC).timestamp()
    axis = Axis(noon - 86400, noon + 86400, "", "time")
    assert axis.ticks() == [(noon, "2026-05-13")]


def test_the_phase_of_a_resonance_falls_from_0_to_minus_180_degrees():
    """1 / (k - m w^2 + i w c): 0 far below the resonance, -90 at it, -180 far above."""
    frequency = np.geomspace(30.0, 1600.0, 400)
    w, w0 = 2 * np.pi * frequency, 2 * np.pi * 200.0
    response = 1.0 / (w0**2 - w**2 + 2j * 0.05 * w0 * w)
    row = {
        "frequency_hz": frequency, "h1_real_m_n": response.real, "h1_imag_m_n": response.imag,
        "passed": np.ones(400, dtype=bool),
    }  # fmt: skip
    path = re.search(r'<path class="curve" data-series="H1" d="M([^"]*)"', phase_panel(HammerTest(row, {}, [], [])))[1]
    points = np.cumsum(np.array(re.findall(r"-?[\d.]+", path), dtype=float).reshape(-1, 2), axis=0)
    phase = 200.0 - 400.0 * (points[:, 1] - TOP) / (190 - TOP - BOTTOM)
    assert abs(phase[0]) < 3.0 and abs(phase[-1] + 180.0) < 3.0
    at_resonance = np.argmin(
        np.abs(points[:, 0] - Axis(30.0, 1600.0, "", "log").share(200.0) * (462 - LEFT - RIGHT) - LEFT)
    )
    assert phase[at_resonance] == pytest.approx(-90.0, abs=12.0)


def test_a_long_title_has_two_lines_and_does_not_change_the_plot_area():
    short, long = (
        Chart(Axis(0.0, 1.0), Axis(0.0, 1.0), words) for words in ("Phase", "Free decay of one impact, " * 3)
    )
    titles = re.findall(r'<text class="title" x="62" y="(\d+)">([^<]*)', long.svg())
    assert [y for y, _ in titles] == ["16", "29"] and all(6.9 * len(words) <= 462 - LEFT for _, words in titles)
    assert long.height == short.height + 13
    assert float(long.py(0.0) - long.py(1.0)) == float(short.py(0.0) - short.py(1.0))


def boxes_of_labels(svg):
    """(row, left, right) of each horizontal label, (None, px, px) of each label along its line."""
    found = re.findall(
        r'<g data-px="([\d.]+)"[^>]*><text class="\w+" (?:x="(-?\d+)" y="(\d+)" text-anchor="(\w+)"|'
        r"transform[^>]*)>([^<]*)",
        svg,
    )
    for px, dx, y, anchor, words in found:
        start = float(px) + float(dx or 0)
        ends = (start, start + 6.2 * len(words)) if anchor == "start" else (start - 6.2 * len(words), start)
        yield (y, *ends) if anchor else (None, float(px), float(px))


@pytest.mark.parametrize("edge", [650.0, 905.0, 1500.0])
def test_no_label_overlaps_another_label_or_a_line(edge):
    c = Chart(Axis(30.0, 1600.0, "f", "log"), Axis(0.0, 1.0))
    lines = {"ballast 104 Hz": 104.0, "railpad 614 Hz": 614.0, "band edge of the hammer": edge}
    for words, frequency in lines.items():
        c.vertical(frequency, "mode", words)
    boxes = list(boxes_of_labels(c.svg()))
    assert len(boxes) == 3
    for row, low, high in boxes:
        assert LEFT <= low and high <= 462 - RIGHT
        assert not any(low < float(c.px(f)) < high for f in lines.values())
        assert sum(r == row and a < high and low < b for r, a, b in boxes if row) <= 1


def test_the_axis_of_one_campaign_without_an_error_has_short_numbers():
    mode = {
        "measured_at_utc": datetime(2026, 5, 13), "frequency_hz": 102.13, "frequency_se_hz": None, "n_impacts": 1,
        "damping_ratio": 0.05, "damping_se": None, "rail_temperature_c": None,
    }  # fmt: skip
    svg = history_panel("ballast", [mode], [], [])
    ticks = re.findall(r">([^<]*)</text>", svg[svg.index('class="tick y"') :].split("</g>")[0])
    assert len(ticks) >= 3 and max(map(len, ticks)) <= 5


def test_values_of_a_history_have_as_many_digits_as_their_intervals_justify():
    """Half widths are 2.306 standard errors: 0.0461 of the damping ratio and 11.5 Hz, stated with two digits."""
    mode = {
        "measured_at_utc": datetime(2026, 5, 13), "frequency_hz": 102.1326, "frequency_se_hz": 5.0, "n_impacts": 9,
        "damping_ratio": 0.12345, "damping_se": 0.02, "rail_temperature_c": None,
    }  # fmt: skip
    svg = history_panel("ballast", [mode], [], [])
    assert "ballast: 102 ± 12 Hz (95 %)" in svg and "102 Hz ± 12 (95 %), damping 0.123, n = 9" in svg
    svg = history_panel("ballast", [mode], [], [], quantity=DAMPING)
    assert "ballast damping: 0.123 ± 0.046 (95 %)" in svg and "102 Hz, damping 0.123 ± 0.046 (95 %), n = 9" in svg


def test_the_label_of_a_point_has_the_name_of_its_campaign():
    mode = {
        "measured_at_utc": datetime(2026, 5, 12, 22, 30), "campaign_id": "t/2026-05-13", "frequency_hz": 102.1,
        "frequency_se_hz": 5.0, "n_impacts": 9, "damping_ratio": 0.12, "damping_se": 0.02, "rail_temperature_c": None,
    }  # fmt: skip
    svg = history_panel("ballast", [mode], [], [])
    assert "2026-05-13: 102 Hz" in svg and "2026-05-12:" not in svg


def test_one_uncertain_campaign_does_not_flatten_a_history():
    """Its expected range, -200 to 400 Hz, is cut off: the axis stays within one span of the campaigns and above 0."""
    mode = {
        "frequency_se_hz": 1.0,
        "damping_ratio": 0.1,
        "damping_se": 0.01,
        "n_impacts": 9,
        "rail_temperature_c": 15.0,
    }
    days = [datetime(2026, 1, 1 + 7 * k) for k in range(4)]
    modes = [mode | {"measured_at_utc": day, "frequency_hz": 100.0 + k} for k, day in enumerate(days)]
    ranges = [(95.0, 105.0)] * 3 + [(-200.0, 400.0)]
    charts = [
        {"measured_at_utc": day, "expected_low_hz": low, "expected_high_hz": high, "state": "ok"}
        for day, (low, high) in zip(days, ranges)
    ]
    low, high, *_ = re.search(r'data-y="([-\d. ]+)', history_panel("ballast", modes, charts, []))[1].split()
    span = 3.0 + 2.0 * 2.306  # of 100 to 103 Hz, each with Student's t of nine impacts
    assert float(low) == pytest.approx(100.0 - 2.306 - span - 0.24 * span, abs=0.02)
    assert float(high) == pytest.approx(103.0 + 2.306 + span + 0.24 * span, abs=0.02)


def test_what_is_not_drawn_has_no_name_in_the_legend():
    """A line or a band of one point is invisible: the name of a mean stood below charts with one campaign."""
    chart = Chart(Axis(0.0, 2.0, "x"), Axis(0.0, 2.0, "y"))
    chart.line([1.0], [1.0], "curve", "mean")
    chart.line([0.0, 1.0, 2.0], [1.0, np.nan, 1.0], "curve", "mean")
    chart.band([1.0], [0.5], [1.5], "expected", "expected")
    assert "data-series" not in chart.svg()
    chart.line([0.0, 1.0], [1.0, 1.0], "curve", "mean")
    chart.band([0.0, 1.0], [0.5, 0.5], [1.5, 1.5], "expected", "expected")
    assert chart.svg().count("data-series") == 2


def test_the_last_tick_of_a_time_axis_is_not_cut_off():
    first, last = 1764547200.0, 1777593600.0  # 2025-12-01 and 2026-05-01
    svg = Chart(Axis(first, last, "", "time"), Axis(0.0, 1.0, "y")).svg()
    labels = re.findall(r'<text x="([\d.]+)" y="\d+">([A-Z][a-z]{2} \d{4})</text>', svg)
    width = float(re.search(r'viewBox="0 0 (\d+)', svg)[1])
    assert len(labels) > 3 and labels[-1][1] == "May 2026"
    assert all(float(x) + 0.5 * LETTER * len(words) < width for x, words in labels)
