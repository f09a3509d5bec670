"""The sample output in docs/passages.md has the lines that the command prints."""

from types import SimpleNamespace

from turnout.cli.passage import FIT_HEAD, _train_lines, score_basis
from turnout.config.settings.passage import PassageSettings


def test_the_sample_has_the_heading_the_basis_and_a_row_with_a_known_status_per_sensor(repository):
    page = (repository / "docs" / "passages.md").read_text(encoding="utf-8")
    sample = page.split("$ turnout passage", 1)[1].split("```", 1)[0]
    assert FIT_HEAD in sample and score_basis(PassageSettings()) in sample
    rows = sample.split(FIT_HEAD, 1)[1].strip("\n").splitlines()[:-1]
    assert [row.split()[0] for row in rows] == ["OT", "SP", "CLP", "A7", "A8", "A9", "ASM", "ASD"]
    status = {row.split()[-1] for row in rows if "does not record" not in row}
    assert status <= {"accepted", "not_an_impulse", "null_explains", "rejected"}


def test_the_uncertainties_are_95_percent_intervals_as_on_the_pages(repository):
    """The standard errors 0.14 km/h and 0.06 m/s² are those of the sample."""
    recording = SimpleNamespace(source="a.h5", record=0, duration=3.7)
    speed = SimpleNamespace(
        speed=140.1 / 3.6, se=0.14 / 3.6, source="both", acceleration=0.01, acceleration_se=0.06, disagreement=None
    )
    type_ = SimpleNamespace(type="IC3", probability=1.0, residual=None, vehicles=())
    passage = SimpleNamespace(
        status="accepted", findings=(), speed=speed, type=type_, n_axle=8, contrast=5.9, direction="facing",
        track="main", offsets=(0.0,),
    )  # fmt: skip
    everything = _train_lines(recording, passage)
    lines = [line for line in everything if "±" in line]
    page = (repository / "docs" / "passages.md").read_text(encoding="utf-8")
    assert len(lines) == 2 and all("(95 %)" in line and line in page for line in lines)
    (of_type,) = (line for line in everything if "probability" in line)
    assert "1.000" not in of_type and of_type in page
