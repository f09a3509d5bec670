"""Draw the two pictures of pages in README from a registry: the page of a turnout with an alarm, and a named mismatch.

    make demo                                                   # the registry of the demonstration
    python examples/gallery.py results/registry docs/gallery tommerup_s2 A8
    turnout diagnose --turnout t1                               # any turnout with a named finding
    python examples/gallery.py results/pages/findings/t1.html docs/gallery

It needs Chromium. A turnout's picture is the head of its page above the section with the alarm.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

WIDTH, HEAD, SECTION, FINDING = 1060, 835, 665, 2100  # px


def main(source: str, gallery: str, turnout: str = "", section: str = "") -> None:
    """Draw one picture."""
    with tempfile.TemporaryDirectory() as folder:
        if not turnout:
            screenshot(Path(source).read_text(encoding="utf-8"), Path(folder), FINDING).save(
                Path(gallery) / "mismatch.png", optimize=True
            )
            return
        from turnout.registry.database import open_registry
        from turnout.report.job import report_job

        with open_registry(source) as connection:
            newest = connection.execute("select max(measured_at_utc)::date from models_current").fetchall()[0][0]
        report_job(source, folder, [turnout], day=str(newest))
        text = (Path(folder) / "turnouts" / f"{turnout}.html").read_text(encoding="utf-8")
        start = text.index(f'<h2 id="{section}"')
        end = re.compile(rf'<h2(?! id="{section}")').search(text, start)
        main_start = text.index('<main id="main">') + len('<main id="main">')
        own = text[:main_start] + text[start : end.start() if end else None] + text[text.index("</main>") :]
        own = re.sub(r"<header>.*?</header>", "", own, flags=re.S)
        head, below = screenshot(text, Path(folder), HEAD), screenshot(own, Path(folder), SECTION)
        picture = Image.new("RGB", (WIDTH, HEAD + SECTION), "white")
        picture.paste(head, (0, 0))
        picture.paste(below, (0, HEAD))
        picture.quantize(128).save(Path(gallery) / "turnout.png", optimize=True)


def screenshot(text: str, folder: Path, height: int) -> Image.Image:
    """The top of a page as a picture."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if browser is None:
        raise SystemExit("no Chromium on this machine")
    (folder / "picture.html").write_text(text, encoding="utf-8")
    command = [browser, "--headless", "--no-sandbox", "--hide-scrollbars", "--virtual-time-budget=3000"]
    command += [f"--user-data-dir={folder}/profile", f"--window-size={WIDTH},{height}"]
    command += [f"--screenshot={folder}/picture.png", (folder / "picture.html").as_uri()]
    subprocess.run(command, check=True, capture_output=True)
    return Image.open(folder / "picture.png").convert("RGB")


if __name__ == "__main__":
    main(*sys.argv[1:])
