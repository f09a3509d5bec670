"""The sample output in docs/passages.md has the lines that the command prints."""

from turnout.cli.passage import FIT_HEAD, score_basis
from turnout.config.settings.passage import PassageSettings


def test_the_sample_has_the_head_the_basis_and_a_row_of_known_status_per_sensor(repository):
    page = (repository / "docs" / "passages.md").read_text(encoding="utf-8")
    sample = page.split("$ turnout passage", 1)[1].split("```", 1)[0]
    assert FIT_HEAD in sample and score_basis(PassageSettings()) in sample
    rows = sample.split(FIT_HEAD, 1)[1].strip("\n").splitlines()[:-1]
    assert [row.split()[0] for row in rows] == ["OT", "SP", "CLP", "A7", "A8", "A9", "ASM", "ASD"]
    status = {row.split()[-1] for row in rows if "does not record" not in row}
    assert status <= {"accepted", "not_an_impulse", "null_explains", "rejected"}
