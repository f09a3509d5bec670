"""The built package runs everything outside the checkout, in folders whose names have a space and an umlaut."""

import importlib.metadata
import os
import shutil
import subprocess
import sys
import tarfile
import zipfile

import pytest

import turnout
from turnout.cli.main import main

NOT_SOURCE = shutil.ignore_patterns(
    ".?*", "build", "dist", "results", "work", "raw", "truth", "demo", "real", "logs", "__pycache__", "*.egg-info"
)
LAYOUT_SECTIONS = ("A7", "A8")


def build(command, folder, out):
    """Run one hook of the build backend in ``folder``; returns the file it made."""
    code = f"import setuptools.build_meta as backend; print(backend.{command}({str(out)!r}))"
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return out / done.stdout.splitlines()[-1]


@pytest.fixture(scope="module")
def archives(tmp_path_factory, repository):
    """The source archive, and the wheel built from its content."""
    version = importlib.metadata.version("setuptools")
    if int(version.partition(".")[0]) < 77:
        pytest.skip(f"a build without network needs setuptools 77 or newer here, and {version} is installed")
    folder = tmp_path_factory.mktemp("Bau für Gleis")
    shutil.copytree(repository, folder / "source", ignore=NOT_SOURCE)
    sdist = build("build_sdist", folder / "source", folder)
    with tarfile.open(sdist) as archive:
        archive.extractall(folder / "unpacked", filter="data")
    (unpacked,) = (folder / "unpacked").iterdir()
    return sdist, build("build_wheel", unpacked, folder)


def test_the_wheel_holds_workflow_configuration_and_templates(archives, repository):
    with zipfile.ZipFile(archives[1]) as wheel:
        names = set(wheel.namelist())
        metadata = wheel.read(next(n for n in names if n.endswith("METADATA"))).decode()
    needed = ["Snakefile", *(f"rules/{p.name}" for p in (repository / "rules").glob("*.smk"))]
    needed += [str(p.relative_to(repository)) for p in (repository / "scripts").glob("*.py")]
    needed += [str(p.relative_to(repository)) for p in (repository / "profiles").rglob("*.yaml")]
    needed += [f"config/schema/{name}.json" for name in ("config", "layout", "override")]
    needed += ["config/tracks/tommerup.yaml", "config/vehicles/axle_patterns.yaml", "config/turnouts.tsv"]
    assert not {f"turnout/shipped/{name}" for name in needed} - names
    package = repository / "src" / "turnout"
    data = [p for p in package.rglob("*") if p.suffix in (".sql", ".csv", ".html", ".css", ".j2", ".json", ".typed")]
    assert not {str(p.relative_to(package.parent)) for p in data} - names
    assert f"Version: {turnout.__version__}" in metadata
    for minor in (11, 12, 13):
        assert f"Programming Language :: Python :: 3.{minor}" in metadata


@pytest.fixture(scope="module")
def installed(archives, tmp_path_factory):
    """Function that runs a program of a new environment, which holds the wheel, in a new folder."""
    folder = tmp_path_factory.mktemp("Gleis Süd")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "env"], check=True)
    python = folder / "env" / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*pip, archives[1]], check=True)
    (site,) = (folder / "env" / "lib").glob("python*/site-packages")
    # Dependencies are those of this environment. Its editable packages do not count: no .pth file there is read.
    (site / "dependencies.pth").write_text("\n".join(p for p in sys.path if p.endswith("-packages")) + "\n")
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    environment |= {"PATH": f"{python.parent}{os.pathsep}{os.environ['PATH']}"}

    def call(program, *options, cwd=".", check=True):
        done = subprocess.run(
            [python.parent / program, *options], cwd=folder / cwd, env=environment, capture_output=True, text=True
        )
        assert not check or done.returncode == 0, done.stdout + done.stderr
        return done.stdout + done.stderr

    assert str(folder) in call("python", "-c", "import turnout; print(turnout.__file__)")
    return call, folder


def test_version_is_that_of_the_package(installed):
    call, _ = installed
    assert call("turnout", "--version") == f"turnout {turnout.__version__}\n"


def test_a_new_project_goes_from_init_to_pages(installed):
    call, folder = installed
    call("turnout", "init", "Weichen Köln")
    project = folder / "Weichen Köln"
    assert len((project / "README.md").read_text().splitlines()) <= 10
    assert (project / "raw").is_dir() and [p.name for p in (project / "config/layouts").iterdir()] == ["tommerup.yaml"]
    assert "0 turnouts" in call("turnout", "check", cwd=project)
    call("turnout", "add", "W1", "tommerup", cwd=project)
    for section in LAYOUT_SECTIONS:  # by the program of the checkout, whose kernels are compiled already
        folders = ["--configuration", str(project / "config"), "--raw", str(project / "raw")]
        assert main(["simulate", "hammer", "--turnout", "W1", "--section", section, *folders]) == 0
    notes = "campaign,started_at_utc,rail_temperature_c\n2024-05-13,2024-05-13T09:00,15\n"
    (project / "raw/W1/campaigns.csv").write_text(notes)
    assert "2 files in 2 units, 0 left out" in call("turnout", "check", cwd=project)
    assert "rule hammer" in call("python", "-m", "snakemake", "--dry-run", "--cores", "1", cwd=project)
    (project / "Snakefile").unlink()  # a project of its own need not have it, nor profiles
    shutil.rmtree(project / "profiles")
    assert "sound: 2 units known, 2 processed" in call("turnout", "nightly", cwd=project)
    answer = call("turnout", "query", "select count(*) as modes from modes_current", cwd=project)
    assert answer.split()[-3] == "4"  # two sections with a ballast and a railpad mode each
    assert "W1" in (project / "results/pages/index.html").read_text(encoding="utf-8")


def test_init_changes_no_project(installed):
    call, folder = installed
    call("turnout", "init", "once")
    (folder / "once/config/config.yaml").write_text("fleet: {shards: 2}\n")
    said = call("turnout", "init", "once", check=False)
    assert "a configuration is here already" in said
    assert (folder / "once/config/config.yaml").read_text() == "fleet: {shards: 2}\n"


def test_tracks_and_configuration_of_the_package_are_found(installed):
    """Without a project the tracks and vehicles of the demonstration are used."""
    call, folder = installed
    (folder / "empty").mkdir()
    code = "import turnout; print(turnout.load_track('tommerup').locations['A7'], turnout.load_vehicle('ic3').name)"
    assert call("python", "-c", code, cwd="empty").split()[-1] == "IC3"
    code = "from pathlib import Path; from turnout.workflow.project import use_demonstration as f; f(Path())"
    call("python", "-c", code, cwd="empty")
    assert "3 turnouts" in call("turnout", "check", cwd="empty")
