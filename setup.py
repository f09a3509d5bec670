"""Puts the workflow and the configuration of the demonstration into a built package, as ``turnout/shipped``.

All else is in pyproject.toml. An editable installation reads them from the checkout.
"""

from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

ROOT = Path(__file__).parent
SHIPPED = (
    "Snakefile",
    "docs/glossary.md",
    "rules/*.smk",
    "scripts/*.py",
    "profiles/*/config.yaml",
    "config/*.yaml",
    "config/*.tsv",
    "config/events.csv",
    "config/layouts/*.yaml",
    "config/schema/*.json",
    "config/tracks/*.yaml",
    "config/vehicles/*.yaml",
    "examples/recordings_of_others/**/*.*",
)


class BuildWithWorkflow(build_py):
    """Copies the files of ``SHIPPED`` beside the modules of the package."""

    def run(self) -> None:
        """Copy modules, then the files of ``SHIPPED``."""
        super().run()
        if self.editable_mode:
            return
        for pattern in SHIPPED:
            for path in sorted(ROOT.glob(pattern)):
                target = Path(self.build_lib, "turnout", "shipped", path.relative_to(ROOT))
                self.mkpath(str(target.parent))
                self.copy_file(str(path), str(target))


setup(cmdclass={"build_py": BuildWithWorkflow})
