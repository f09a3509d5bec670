"""Pages of a small registry that went through the whole chain, read as a reader would."""

import re
from datetime import date
from html.parser import HTMLParser

import numpy as np
import pytest

from turnout.chains.hammer import hammer_unit
from turnout.config import load_configuration, with_raw
from turnout.demo.hammer import hammer_test
from turnout.fleet.batches import UnitResult, read_results, write_batch
from turnout.fleet.scan import scan, unit_id
from turnout.fleet.tables import configuration_rows
from turnout.published.response import paper_response
from turnout.readers.writing import write
from turnout.registry.database import open_registry
from turnout.registry.register import register
from turnout.report.write import write_pages

DAYS = (date(2024, 5, 13), date(2024, 6, 17))


@pytest.fixture(scope="module")
def pages(tmp_path_factory, repository):
    """(folder of pages, open registry) of tommerup_s1 with two sections and two campaigns; the second SP is cut off."""
    root = tmp_path_factory.mktemp("fleet")
    raw, notes = root / "raw", ["campaign,started_at_utc,rail_temperature_c"]
    rng = np.random.default_rng(3)
    for day in DAYS:
        folder = raw / "tommerup_s1" / "hammer" / day.isoformat()
        folder.mkdir(parents=True)
        notes.append(f"{day},{day}T09:00:00,12.0")
        for section in ("A7", "SP"):
            recordings, _ = hammer_test(paper_response(section, 1.0, 1.0), 12.0, day, 1, rng)
            write(recordings, folder / f"{section}_1.npz", "npz")
    (folder / "SP_1.npz").write_bytes((folder / "SP_1.npz").read_bytes()[:5000])
    (raw / "tommerup_s1" / "campaigns.csv").write_text("\n".join(notes) + "\n")
    configuration = load_configuration(repository / "config")
    turnout = with_raw(configuration.turnout("tommerup_s1"), raw)
    results = [
        UnitResult(unit_id(u), u.turnout, u.kind, "key", "1", "ok", hammer_unit(u, turnout, raw, algo="1"))
        for u in scan(turnout, raw).units
    ]
    batch = write_batch(root / "work", results)
    tables = configuration_rows(configuration, raw, [])
    register([batch], root / "registry", read=read_results, tables=tables)
    with open_registry(root / "registry") as connection:
        write_pages(connection, root / "pages", 1, progress=False)
        yield root / "pages", connection


class Reader(HTMLParser):
    """Text, links and anchors of a page."""

    def __init__(self, text):
        super().__init__()
        self.words, self.links, self.ids, self.hidden = [], [], set(), 0
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.hidden += tag == "style"
        if "href" in attributes:
            self.links.append(attributes["href"])
        if "id" in attributes:
            self.ids.add(attributes["id"])

    def handle_endtag(self, tag):
        self.hidden -= tag == "style"

    def handle_data(self, data):
        if not self.hidden:
            self.words.append(data)


def read(path):
    return Reader(path.read_text())


def test_every_link_leads_somewhere_and_nothing_comes_from_the_network(pages):
    folder, _ = pages
    for path in folder.rglob("*.html"):
        page = read(path)
        for link in page.links:
            file, _, anchor = link.partition("#")
            target = (path.parent / file).resolve() if file else path
            assert target.exists(), f"{path.name} links to {link}"
            assert not anchor or anchor in read(target).ids, f"{path.name} links to {link}"
        assert "http" not in re.sub(r"xmlns[^ >]*", "", path.read_text()) and "<script" not in path.read_text()


def test_no_page_shows_a_missing_value_as_none_or_nan(pages):
    folder, _ = pages
    for path in folder.rglob("*.html"):
        text = path.read_text()
        assert not re.search(r"\b(nan|NaN|None|null)\b", text.replace("(null ", "(")), path.name


def test_the_resonance_on_the_page_is_the_registrys_with_its_interval_and_n(pages):
    from scipy.stats import t as student

    folder, connection = pages
    frequency, error, n = connection.execute(
        """select frequency_hz, frequency_se_hz, n_impacts from modes_current
        where section_id = 'tommerup_s1/A7' and band = 'ballast' order by measured_at_utc desc limit 1"""
    ).fetchall()[0]
    words = " ".join(read(folder / "turnouts" / "tommerup_s1.html").words)
    half = student.ppf(0.975, n - 1) * error
    assert f"{frequency:.1f} ± {half:.1f}" in words
    # the paper's 99.4 Hz with its blow-to-blow spread of 0.6 %
    assert abs(frequency - 99.4) < 1.0


def test_what_was_not_used_is_named_with_its_reason_and_remedy(pages):
    folder, _ = pages
    words = " ".join(read(folder / "turnouts" / "tommerup_s1.html").words)
    assert "SP_1.npz" in words and "In quarantine" in words


def test_a_section_without_measurements_says_so(pages):
    folder, _ = pages
    words = " ".join(read(folder / "turnouts" / "tommerup_s1.html").words)
    assert "No model yet." in words and "not measured" in words


def test_a_fleet_without_data_has_a_page(tmp_path):
    register([], tmp_path / "registry", read=read_results)
    with open_registry(tmp_path / "registry") as connection:
        assert write_pages(connection, tmp_path / "pages", progress=False) == 1
    assert "Nothing to do" in " ".join(read(tmp_path / "pages" / "index.html").words)
