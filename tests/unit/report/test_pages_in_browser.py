"""Pages in headless Chromium: no errors, no horizontal scrolling, zoom and values of the charts."""

import json
import os
import re
import shutil
import subprocess
from datetime import datetime, timedelta
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from turnout.registry.database import open_registry
from turnout.registry.job import register
from turnout.report.pages.finding import finding_page
from turnout.report.pages.turnout import turnout_page
from turnout.report.panels.hammer import HammerTest, receptance_panel, stabilisation_panel
from turnout.report.panels.history import history_panel
from turnout.report.site import page_environment, shared_by_pages, write_pages
from turnout.report.source import ROWS
from turnout.report.trains import ROWS as OF_TRAINS

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
# axe-core: `npm pack axe-core` and unpack it, then TURNOUT_AXE=package/axe.min.js
AXE = Path(os.environ.get("TURNOUT_AXE", "axe.min.js"))
REPORT = """<script>addEventListener('load', async function () { var result;
try { SCRIPT } catch (e) { result = String(e); }
var text = JSON.stringify(result).replace(/&/g, '&amp;').replace(/</g, '&lt;');
document.documentElement.innerHTML = '<body><pre id=out>' + text + '</pre></body>'; });</script>"""


def in_browser(html, script, folder, *flags):
    """Value of ``result`` after ``script`` ran in the page, and the messages of the console."""
    path = folder / "page.html"
    report = REPORT.replace("SCRIPT", script)
    path.write_text(html.replace("</body>", f"{report}</body>"), encoding="utf-8")
    command = [
        BROWSER,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--enable-logging=stderr",
        "--virtual-time-budget=20000",
        "--allow-file-access-from-files",
        "--window-size=1060,900",
        f"--user-data-dir={folder / 'profile'}",
        *flags,
        "--dump-dom",
        path.as_uri(),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    found = re.search(r'<pre id="out">(.*?)</pre>', done.stdout, re.S)
    assert found, done.stdout[-500:] + done.stderr[-2000:]
    text = found[1].replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&")
    return json.loads(text), re.findall(r"CONSOLE.*", done.stderr)


SECTION = {"section_id": "t/A7", "turnout_id": "t", "label": "A7", "panel": "CP", "track": "main", "position_m": 21.4}
FREQUENCY = np.linspace(3.0, 1600.0, 500)


def receptance_row():
    """Receptance of one degree of freedom: 100 kg, 155 Hz, damping ratio 0.05."""
    w, w0 = 2 * np.pi * FREQUENCY, 2 * np.pi * 155.0
    response = 1.0 / (100.0 * (w0**2 - w**2 + 2j * 0.05 * w0 * w))
    poles = [
        {"order": o, "frequency": 155.0 + 0.1 * o, "damping": 0.05, "status": "stable", "emac": 0.987, "energy": 0.42}
        for o in (2, 4)
    ]
    return dict.fromkeys(("coherence", "coherence_low", "coherence_high"), np.full(500, 0.95)) | {
        "section_id": "t/A7",
        "model_id": "m",
        "measured_at_utc": datetime(2026, 5, 1, 9),
        "n_impacts": 10,
        "frequency_hz": FREQUENCY,
        "h1_real_m_n": response.real,
        "h1_imag_m_n": response.imag,
        "h2_abs_m_n": 1.02 * np.abs(response),
        "passed": FREQUENCY > 20.0,
        "gate": "limit",
        "gate_required": 0.8,
        "valid_to_hz": 905.0,
        "decay_ms2": np.sin(np.arange(600) / 9.0),
        "decay_model_ms2": np.sin(np.arange(600) / 9.1),
        "decay_rate_hz": 20_000.0,
        "stabilisation_json": json.dumps(poles),
    }


MODEL = {
    "section_id": "t/A7",
    "model_id": "m",
    "measured_at_utc": datetime(2026, 5, 1, 9),
    "status": "accepted",
    "reason": None,
    "detail": None,
    "n_impacts_used": 10,
    "model_order": 4,
    "hammer_fit_pct": 81.0,
    "hammer_fit_null_pct": 12.0,
}
MODES = [
    {
        "turnout_id": "t",
        "section_id": "t/A7",
        "model_id": "m" if k == 5 else f"m{k}",
        "band": "ballast",
        "measured_at_utc": datetime(2025, 12, 1) + timedelta(days=30 * k),
        "frequency_hz": 155.0 + 0.37 * k,
        "frequency_se_hz": 0.4,
        "damping_ratio": 0.05,
        "damping_se": 0.002,
        "n_impacts": 10,
        "rail_temperature_c": 12.0,
    }
    for k in range(6)
]
CHARTS = [
    {
        "section_id": "t/A7",
        "band": "ballast",
        "measured_at_utc": m["measured_at_utc"],
        "expected_low_hz": 153.5,
        "expected_high_hz": 158.25,
        "state": "ok",
        "deviation_pct": None,
    }
    for m in MODES
]


def turnout_text():
    impacts = [
        {
            "section_id": "t/A7",
            "status": "accepted",
            "reason": None,
            "detail": "",
            "record": k,
            "test": 1,
            "peak_n": 8e3,
        }
        for k in range(10)
    ]
    rows = {kind: [] for kind in (*ROWS, *OF_TRAINS)} | {
        "sections": [SECTION],
        "models": [MODEL],
        "receptances": [receptance_row()],
        "modes": MODES,
        "charts": CHARTS,
        "impacts": impacts,
    }
    turnout = {"turnout_id": "t", "name": "Junction", "line": "L1", "km": 1.5, "layout": "main"}
    return turnout_page(rows, turnout, page_environment().get_template("turnout.html"), shared_by_pages(1)).replace(
        "<details>", "<details open>"
    )


def finding_text():
    x = np.linspace(0.01, 0.8, 200)
    values = {"measured": np.sin(9 * x), "before": np.sin(8 * x), "after": np.sin(9.1 * x)}
    curve = {
        "finding_id": "f1",
        "label": "passage 1, held out",
        "curve": "waveform",
        "curve_no": 0,
        "x": x,
        "x_unit": "s",
        "x_label": "time",
        "y_unit": "m/s²",
    } | values
    row = {
        "finding_id": "f1",
        "turnout_id": "t",
        "section_id": "t/A7",
        "found_at_utc": datetime(2026, 7, 25, 10),
        "verdict": "named",
        "grade": "A",
        "term": "hanging_sleeper",
        "rival_term": None,
        "locked_to": None,
        "position_m": 24.6,
        "position_se_m": 0.1,
        "channel": None,
        "band_low_hz": 21.0,
        "band_high_hz": 88.0,
        "probability": 0.97,
        "p_value": None,
        "fit_before_pct": 41.0,
        "fit_after_pct": 78.0,
        "fit_rival_pct": 50.0,
        "fit_decoy_pct": 43.0,
        "n_held_out": 2,
        "sentence": "",
        "next_measurement": "Look under this sleeper",
        "visit": "2026-07-25",
        "sections": "A7",
        "route": "main",
        "place_low_m": 24.6,
        "place_high_m": 24.6,
        "train": None,
        "axle": None,
        "wheel_within_m": 0.9,
        "n_hammer_tests": 1,
        "n_passages": 6,
        "n_sensors": 1,
        "level_before": 3.0,
        "level_after": 1.1,
        "evidence_json": "{}",
        "notes": None,
        "term_json": json.dumps(
            [
                {
                    "term": "hanging_sleeper",
                    "fixed": {"sleeper": 24.6},
                    "parameters": {"gap": {"value": 1.12e-3, "se": 0.05e-3, "unit": "m"}},
                }
            ]
        ),
    }
    rows = {
        "sections": [SECTION],
        "mismatch_findings": [row],
        "quarantine": [],
        "mismatch_parameters": [],
        "mismatch_curves": [curve],
    }
    shared = shared_by_pages(1) | {"finding_css": (files("turnout.report") / "templates" / "finding.css").read_text()}
    template = page_environment().get_template("finding.html")
    return finding_page({"turnout_id": "t", "name": "Junction"}, rows, template, shared)


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """HTML of one page of each kind."""
    root = tmp_path_factory.mktemp("pages")
    turnouts = [
        {"turnout_id": f"t{k}", "name": f"Junction {k}", "line": "L1", "km": 1.5 * k, "layout": "main"}
        for k in range(3)
    ]
    register([], root / "registry", read=iter, tables={"turnouts": turnouts})
    with open_registry(root / "registry") as connection:
        write_pages(connection, root / "pages", 1, progress=False)
    written = {name: (root / "pages" / f"{name}.html").read_text("utf-8") for name in ("index", "glossary")}
    return {**written, "turnout": turnout_text(), "finding": finding_text()}


KINDS = ("index", "glossary", "turnout", "finding")


def in_frames(pages, script, folder, *flags, more=""):
    """Run ``in_browser`` with each page in a frame of 390 px, as a window of Chromium has at least 500 px."""
    frames = ""
    for kind in KINDS:
        (folder / f"{kind}.html").write_text(pages[kind].replace("</body>", more + "</body>"), encoding="utf-8")
        frames += f"<iframe id={kind} src={kind}.html style='width:390px;height:900px;border:0'></iframe>"
    kinds = f"var kinds = {json.dumps(KINDS)}, frame = kind => document.getElementById(kind); result = {{}};"
    return in_browser(f"<body>{frames}</body>", kinds + script, folder, *flags)


def test_no_page_has_an_error_or_scrolls_horizontally_on_a_telephone(pages, tmp_path):
    script = "kinds.forEach(kind => { result[kind] = frame(kind).contentDocument.documentElement.scrollWidth; });"
    widths, console = in_frames(pages, script, tmp_path)
    assert max(widths.values()) <= 390 and not console, widths


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_no_serious_or_critical_violation(pages, scheme, tmp_path):
    if not AXE.exists():
        pytest.skip("no axe-core: npm pack axe-core, unpack it, set TURNOUT_AXE to its axe.min.js")
    axe = "<script>" + AXE.read_text("utf-8").replace("</script>", "<\\/script>") + "</script>"
    script = """for (var kind of kinds) {
        var page = frame(kind).contentWindow, found = await page.axe.run();
        result[kind] = [page.matchMedia('(prefers-color-scheme: dark)').matches, found.passes.length,
            found.violations.filter(v => ['serious', 'critical'].includes(v.impact)).map(v => [v.id, v.nodes[0].html])];
    }"""
    flags = ["--blink-settings=preferredColorScheme=0"] if scheme == "dark" else []
    result, _ = in_frames(pages, script, tmp_path, *flags, more=axe)
    for kind in KINDS:
        is_dark, n_passed, violations = result[kind]
        assert is_dark is (scheme == "dark") and n_passed > 10
        assert violations == [], kind


CHARTS_PAGE = """<!doctype html><html lang="en"><head><title>t</title><style>{css}</style></head>
<body>{charts}<script>{chart_script}</script></body></html>"""
KEYS = """var plots = Array.from(document.querySelectorAll('svg.chart')).map(svg => svg.plot), plot;
    function key(k) { plot.box.focus(); plot.box.dispatchEvent(new KeyboardEvent('keydown', {key: k, bubbles: true})); }
    function said() { return Array.from(plot.tip.childNodes).map(n => n.textContent); }
    function ticks() { return Array.from(plot.svg.querySelectorAll('.tick.x text')).map(n => n.textContent); }
    function display() {
        return Array.from(plot.svg.querySelectorAll('[data-series="H1"]')).map(n => n.style.display);
    }
    result = {}; plot = plots[0];
    result.ticks = [ticks()]; key('+'); result.ticks.push(ticks()); key('0'); result.ticks.push(ticks());
    result.curve = []; for (var k = 0; k < 50; k += 1) { key('ArrowRight'); result.curve.push(said()); }
    var buttons = Array.from(plot.bar.querySelectorAll('button[aria-pressed]'));
    result.names = buttons.map(b => b.textContent);
    buttons[2].click(); result.hidden = [buttons[2].getAttribute('aria-pressed'), display()];
    buttons[2].click(); result.shown = display();
    plot = plots[1]; key('ArrowRight'); key('ArrowRight'); result.dot = said();
    result.focused = document.activeElement === plot.box;
    plot = plots[2]; key('ArrowRight'); result.pole = said();"""


@pytest.fixture(scope="module")
def charts(tmp_path_factory):
    """Texts of a receptance, a history and a stabilization diagram after keys and clicks, and the console."""
    test = HammerTest(receptance_row(), MODEL, [], [])
    drawings = receptance_panel(test) + history_panel("ballast", MODES, CHARTS, []) + stabilisation_panel(test)
    html = CHARTS_PAGE.format(charts=drawings, **shared_by_pages(1))
    return in_browser(html, KEYS, tmp_path_factory.mktemp("charts"))


def test_the_values_shown_on_a_curve_are_those_of_the_registry(charts):
    """Each of 50 values read from the receptance equals that of its frequency line, to the printed digits."""
    result, console = charts
    assert not console and len(result["curve"]) == 50
    back = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
    row = receptance_row()
    size = np.hypot(row["h1_real_m_n"], row["h1_imag_m_n"])
    for head, *texts in result["curve"]:
        frequency = float(re.fullmatch(r"frequency: ([\d.]+) Hz", head)[1])
        line = np.argmin(np.abs(FREQUENCY - frequency))
        assert frequency == pytest.approx(FREQUENCY[line], rel=5e-4)
        (h1,) = (t for t in texts if t.startswith("H1: "))
        mantissa, power = re.fullmatch(r"H1: ([\d.]+)·10([⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+) m/N", h1).groups()
        assert float(mantissa) * 10.0 ** int(power.translate(back)) == pytest.approx(size[line], rel=2e-3)


def test_a_dot_shows_the_text_of_its_campaign(charts):
    result, _ = charts
    assert result["focused"]
    assert result["dot"] == ["2025-12-31: 155.37 Hz ± 0.9 (95 %), damping 0.0500, n = 10, 12 °C"]


def test_a_pole_shows_frequency_damping_coherence_and_energy(charts):
    words = "order 2, stable: 155.2 Hz, damping 0.050, amplitude coherence 0.99, 42.0 % of the energy"
    assert charts[0]["pole"] == [words]


def test_the_key_plus_halves_the_range_and_the_key_zero_shows_all(charts):
    """30 to 1600 Hz, logarithmic: the middle half is 30 * (1600 / 30) ** 0.25 to ** 0.75, 81 to 592 Hz."""
    all_of_it, half, again = charts[0]["ticks"]
    assert again == all_of_it == ["50", "100", "200", "500", "1000"] and half == ["100", "200", "500"]


def test_a_button_hides_and_shows_its_series(charts):
    result, _ = charts
    assert result["names"] == ["between H1 and H2", "H1, fails the gate", "H1"]
    assert result["hidden"] == ["false", ["none"]] and result["shown"] == [""]
