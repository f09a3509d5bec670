"""Write docs/api.md, the reference of the public names of ``turnout``, from their docstrings, and its figure.

Run ``python -m turnout.api.reference_page docs`` to update both; a test compares the page.
``python -m turnout.api.reference_page --example OT_1.uff`` writes the file that the example reads.
"""

from __future__ import annotations

import inspect
import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import turnout

GROUPS = {
    "Read": ("read", "load_configuration"),
    "Hammer tests": ("find_impacts", "receptance", "identify_modes"),
    "Passages": ("analyse_passage",),
    "Simulate": ("load_track", "load_vehicle", "simulate_hammer", "simulate_passage"),
    "Diagnose": ("diagnose",),
    "Registry": ("open_registry",),
}
HEAD = """# Turnout in Python

This page lists the names that `import turnout` offers to scripts and notebooks.

All values are in SI units. `settings=None` means the
defaults of `config/config.yaml`. A result prints in one line; recordings, receptances and modal models have `.plot()`,
which draws with matplotlib and returns the axes. A record, a channel or an impact that cannot be used is a result with
a reason ([reasons](reasons.md)), not an exception. An exception states file, place, problem and remedy.

Five lines lead from a file of a hammer test to modes with error bars and a figure.
`python -m turnout.api.reference_page --example OT_1.uff` writes a simulated file to try them:

```python
{example}
```

![Receptance, and both modes with the estimates of the single impacts](gallery/modes.png)

This page is made from the docstrings: `python -m turnout.api.reference_page docs`.

"""
EXAMPLE = """import turnout

recordings = turnout.read("OT_1.uff")
impacts = turnout.find_impacts(recordings)
model = turnout.identify_modes(impacts)
model.plot()[0].figure.savefig("modes.png")"""
SECTION = re.compile(r"^(\w+)\n-+\n", re.MULTILINE)


def page() -> str:
    """Text of the page."""
    parts = [HEAD.format(example=EXAMPLE)]
    for name in (name for names in GROUPS.values() for name in names):
        parts.append(f"- [`turnout.{name}`](#turnout{name}): {_summary(name)}\n")
    for group, names in GROUPS.items():
        parts.append(f"\n## {group}\n")
        parts += [_reference(name) for name in names]
    return "".join(parts)


def _summary(name: str) -> str:
    return _plain(inspect.getdoc(getattr(turnout, name)) or "").split("\n")[0]


def _reference(name: str) -> str:
    """Signature and docstring of a function in Markdown."""
    function = getattr(turnout, name)
    head, *sections = SECTION.split(inspect.getdoc(function) or "")
    text = [f"\n### turnout.{name}\n\n```python\n{_signature(name, function)}\n```\n\n{_prose(head)}\n"]
    for title, body in zip(sections[::2], sections[1::2]):
        content = _example(body) if title == "Examples" else _prose(body) if title == "References" else _entries(body)
        text.append(f"\n**{title}**\n\n{content}\n")
    return "".join(text)


def _signature(name: str, function: object) -> str:
    """Call of the function with the names and defaults of its parameters, without types: the table has those."""
    words = []
    keyword_only = False
    for parameter in inspect.signature(function).parameters.values():  # type: ignore[arg-type]
        if parameter.kind is parameter.KEYWORD_ONLY and not keyword_only:
            keyword_only = True
            words.append("*")
        words.append(parameter.name + ("" if parameter.default is parameter.empty else f"={parameter.default!r}"))
    return f"turnout.{name}({', '.join(words)})"


def _plain(text: str) -> str:
    return text.replace("``", "`")


def _prose(text: str) -> str:
    """Paragraphs, with equations as GitHub shows them."""
    blocks = []
    for block in _plain(text).strip().split("\n\n"):
        if block.startswith(".. math:: "):
            block = "$$" + " ".join(line.strip() for line in block.removeprefix(".. math:: ").split("\n")) + "$$"
        blocks.append(block)
    return "\n\n".join(blocks)


def _entries(body: str) -> str:
    """A list with one line per parameter, result or error."""
    entries: list[list[str]] = []
    for line in _plain(body).strip().split("\n"):
        if not line.startswith(" "):
            entries.append([line, ""])
        else:
            entries[-1][1] += " " + line.strip()
    rows = []
    for head, text in entries:
        name, colon, kind = head.partition(" : ")
        rows.append(f"- **{name}**{f' ({kind})' if colon else ''}{':' + text if text else ''}")
    return "\n".join(rows)


def _example(body: str) -> str:
    """Text as paragraphs, code with its output as blocks."""
    blocks = []
    for block in body.strip().split("\n\n"):
        blocks.append(f"```python\n{block}\n```" if block.startswith(">>>") else _plain(block))
    return "\n\n".join(blocks)


def write_example_file(path: Path, impacts: int = 10, seed: int = 1) -> Path:
    """Write the file that the example of the page reads: a simulated hammer test at section OT, as UFF 58b.

    Parameters
    ----------
    path : path-like
        File to write.
    impacts : int
        Number of impacts.
    seed : int
        Seed of their scatter and of the noise.

    Returns
    -------
    Path
        The file.
    """
    from turnout.readers.writing import write
    from turnout.simulate.hammer import hammer_sensors

    track = turnout.load_track("tommerup")
    position, _ = track.locations["OT"]
    sensors = hammer_sensors(position)[:1]
    return write(turnout.simulate_hammer(track, "OT", impacts=impacts, sensors=sensors, seed=seed), path, "uff58b")


def draw_figure(path: Path) -> None:
    """Draw the figure of the page into ``path``.

    Parameters
    ----------
    path : Path
        PNG file that is written.
    """
    with TemporaryDirectory() as folder:
        recordings = turnout.read(write_example_file(Path(folder) / "OT_1.uff"))
    model = turnout.identify_modes(turnout.find_impacts(recordings))
    model.plot()[0].figure.savefig(path, dpi=100, metadata={"Software": None})


if __name__ == "__main__":
    if sys.argv[1] == "--example":
        sys.exit(print(write_example_file(Path(sys.argv[2]))))
    docs = Path(sys.argv[1])
    (docs / "api.md").write_text(page(), encoding="utf-8")
    draw_figure(docs / "gallery" / "modes.png")
