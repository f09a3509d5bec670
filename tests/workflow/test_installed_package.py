"""The built package works outside the checkout, in folders whose names have a space and an umlaut."""

import importlib.metadata
import os
import re
import shlex
import shutil
import subprocess
import sys
import tarfile
import zipfile

import pytest

import turnout
from turnout.kernel_cache import cache_folder

NOT_SOURCE = shutil.ignore_patterns(
    ".?*", "build", "dist", "results", "work", "raw", "truth", "demo", "real", "logs", "__pycache__", "*.egg-info"
)


def build(command, folder, out):
    """Run one hook of the build backend in ``folder``; return the file that it creates."""
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


def test_the_wheel_contains_workflow_configuration_and_templates(archives, repository):
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
    """Function that runs a program of a new environment with the wheel, in a new folder."""
    folder = tmp_path_factory.mktemp("Gleis Süd")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "env"], check=True)
    python = folder / "env" / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*pip, archives[1]], check=True)
    (site,) = (folder / "env" / "lib").glob("python*/site-packages")
    # Dependencies are those of this environment, without its editable packages: no .pth file there is read.
    (site / "dependencies.pth").write_text("\n".join(p for p in sys.path if p.endswith("-packages")) + "\n")
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    environment |= {"PATH": f"{python.parent}{os.pathsep}{os.environ['PATH']}"}
    if kernels := cache_folder():  # the code is the same, and its compilation takes a minute
        environment |= {"NUMBA_CACHE_DIR": str(kernels.parent)}

    def call(program, *options, cwd=".", check=True):
        done = subprocess.run(
            [python.parent / program, *options], cwd=folder / cwd, env=environment, capture_output=True, text=True
        )
        assert not check or done.returncode == 0, done.stdout + done.stderr
        return done.stdout + done.stderr

    assert str(folder) in call("python", "-c", "import turnout; print(turnout.__file__)")
    return call, folder


def test_the_version_is_that_of_the_package(installed):
    call, _ = installed
    assert call("turnout", "--version") == f"turnout {turnout.__version__}\n"


TUTORIAL = "docs/tutorial.md"
FENCED = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"\d+\.\d+")
# A number with decimals may differ by 2 %: the last digits of a fit depend on the processor.
RELATIVE_TOLERANCE = 0.02


def shown_commands(body):
    """(words behind ``turnout``, expected lines) of every command of a console block."""
    for part in re.split(r"^\$ ", body, flags=re.MULTILINE)[1:]:
        command, *lines = part.rstrip("\n").split("\n")
        program, *words = shlex.split(command)
        assert program == "turnout", command
        yield words, lines


def agrees(line, shown):
    """Whether a printed line agrees with the shown one: ``...`` stands for any text, decimals may differ."""
    parts = [NUMBER.sub("\0", part) for part in " ".join(shown.split()).split("...")]
    pattern = ".*".join(re.escape(part).replace("\0", r"(\d+\.?\d*)") for part in parts)
    found = re.fullmatch(pattern, " ".join(line.split()))
    expected = [float(n) for n in NUMBER.findall(shown)]
    return found is not None and [float(n) for n in found.groups()] == pytest.approx(expected, rel=RELATIVE_TOLERANCE)


def agree(printed, shown):
    """Whether the printed text contains the shown lines in order; a line ``...`` stands for any number of lines."""
    lines = iter(printed.splitlines())
    for n, line in enumerate(shown):
        if line == "...":
            continue
        may_skip = n > 0 and shown[n - 1] == "..."
        if not (any(agrees(p, line) for p in lines) if may_skip else agrees(next(lines, ""), line)):
            return False
    return True


def test_the_comparison_of_outputs_finds_differences():
    assert agree("a 1.000\nb\nc", ["a 1.010", "...", "c"]) and agree("x 7 Hz, y", ["x 7 ..."])
    assert agree("A7   1.001 10", ["A7    1.00 10"])
    assert not agree("a 1.000\nb\nc", ["a 1.100", "...", "c"]) and not agree("a\nb", ["b"])
    assert not agree("x 8 Hz, y", ["x 7 ..."]) and not agree("a\nb", ["...", "c"])


@pytest.mark.slow
def test_the_commands_of_the_tutorial_give_the_shown_output(installed, repository):
    call, folder = installed
    project, where = folder / "railway", "."
    layout = project / "config/layouts/my_logger.yaml"
    n_commands = 0
    for kind, body in FENCED.findall((repository / TUTORIAL).read_text(encoding="utf-8")):
        if kind == "csv":
            (project / "raw/W1/campaigns.csv").write_text(body, encoding="utf-8")
        elif kind == "yaml":
            entries = {line.split(":")[0]: line for line in body.splitlines()}
            lines = layout.read_text(encoding="utf-8").splitlines()
            assert set(entries) <= {line.split(":")[0] for line in lines}
            layout.write_text("\n".join(entries.get(line.split(":")[0], line) for line in lines), encoding="utf-8")
        for words, lines in shown_commands(body) if kind == "console" else ():
            printed = call("turnout", *words, cwd=where)
            assert agree(printed, lines), f"turnout {shlex.join(words)}\n{printed}"
            n_commands += 1
            where = project
    assert n_commands >= 10
    assert "W1" in (project / "results/pages/index.html").read_text(encoding="utf-8")
    assert len((project / "README.md").read_text(encoding="utf-8").splitlines()) <= 10
    (project / "Snakefile").unlink()  # a project needs neither its own Snakefile nor profiles
    shutil.rmtree(project / "profiles")
    assert "ok: 2 units known, 0 processed" in call("turnout", "nightly", cwd=project)


def test_init_does_not_change_an_existing_project(installed):
    call, folder = installed
    call("turnout", "init", "once")
    (folder / "once/config/config.yaml").write_text("fleet: {shards: 2}\n")
    message = call("turnout", "init", "once", check=False)
    assert "a configuration is here already" in message
    assert (folder / "once/config/config.yaml").read_text() == "fleet: {shards: 2}\n"


def test_tracks_and_configuration_of_the_package_are_found(installed):
    """Without a project, the tracks and vehicles of the demonstration are used."""
    call, folder = installed
    (folder / "empty").mkdir()
    code = "import turnout; print(turnout.load_track('tommerup').locations['A7'], turnout.load_vehicle('ic3').name)"
    assert call("python", "-c", code, cwd="empty").split()[-1] == "IC3"
    code = "from pathlib import Path; from turnout.workflow.project import use_demonstration as f; f(Path())"
    call("python", "-c", code, cwd="empty")
    assert "3 turnouts" in call("turnout", "check", cwd="empty")
