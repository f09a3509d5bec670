"""Numbers in messages: what rounds to zero has the sign of zero."""

import re

SIGNED = re.compile(r"\{[^{}]*:\+(?!z)[\d.]*f\}")


def test_no_signed_number_can_be_minus_zero(repository):
    """-0.04 with one decimal is "+0.0", by the option z of the format: "-0.0 %" reads as a fall."""
    assert SIGNED.search('f"{change:+.1f} %"') and not SIGNED.search('f"{change:+z.1f} %"')
    sources = sorted((repository / "src").rglob("*.py"))
    found = [
        f"{path.relative_to(repository)}: {match[0]}"
        for path in sources
        for match in SIGNED.finditer(path.read_text("utf-8"))
    ]
    assert len(sources) > 300 and not found
