"""Fenced blocks, indented commands and commands within a line of README and documentation."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md")),
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs" / "decisions").glob("*.md")),
]
# A comment before a block states why it is not run, which test runs it, or of which file it is a part.
COMMENT = r"(?:<!-- (?P<key>not run|run by|file): (?P<value>[^\n]+) -->\n+)?"
BLOCK = re.compile(rf"^{COMMENT}```(?P<language>[^\n]*)\n(?P<body>.*?)^```$", re.M | re.S)
INDENTED = re.compile(r"(?:\A|\n)\n((?: {4}\S.*\n)+)")
INLINE = re.compile(r"`(turnout [^`\n]+)`")
CRON = re.compile(r"^(?:[\d*/,-]+ +){5}")
EXPLANATION = re.compile(r"\s{3,}(?![-\s])|\s+[#>]")


@dataclass(frozen=True)
class Block:
    """One fenced block; ``key`` and ``value`` are those of the comment before it."""

    page: Path
    line: int
    language: str
    body: str
    key: str | None
    value: str | None

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def blocks() -> list[Block]:
    """All fenced blocks."""
    found = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for match in BLOCK.finditer(text):
            line = text.count("\n", 0, match.start("language")) + 1
            found.append(Block(page, line, match["language"], match["body"], match["key"], match["value"]))
    return found


def commands(block: Block) -> list[list[str]]:
    """Words of each command of a shell block, without explanations, redirections and variables before it."""
    lines = block.body.replace("\\\n", " ").splitlines()
    if block.language == "console":
        lines = [line.removeprefix("$ ") for line in lines if line.startswith("$ ")]
    return [words for line in lines for words in _split(EXPLANATION.split(CRON.sub("", line))[0]) if words]


def _split(line: str) -> list[list[str]]:
    parts: list[list[str]] = [[]]
    for word in shlex.split(line):
        if word in ("&&", "|", ";"):
            parts.append([])
        elif parts[-1] or not re.match(r"[A-Z_]+=", word):
            parts[-1].append(word)
    return parts


def loose_commands(page: Path) -> list[list[str]]:
    """Commands of the program in indented lines and within the text of a page."""
    text = BLOCK.sub("", page.read_text(encoding="utf-8"))
    indented = [line.strip() for part in INDENTED.findall(text) for line in part.splitlines()]
    typed = [line for line in indented if line.startswith("turnout ")] + INLINE.findall(text)
    return [shlex.split(EXPLANATION.split(line)[0])[1:] for line in typed if "..." not in line and "…" not in line]
