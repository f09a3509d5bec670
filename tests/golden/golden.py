"""Record the results of a state of the program, or compare two recordings. See README.md.

python tests/golden/golden.py record golden/after [--tier quick|full] [--src src] [--only fleet]
python tests/golden/golden.py compare golden/base golden/after
"""

import argparse
import difflib
import hashlib
import os
import re
import resource
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import duckdb

HERE = Path(__file__).resolve().parent
INPUTS = Path(os.environ.get("TURNOUT_GOLDEN_INPUTS", "golden/inputs"))
DAY = "2026-08-01"
MAIN = """
import sys
try:
    from turnout.cli.main import main
except ModuleNotFoundError:  # the code before the command line became a package
    from turnout.cli import main
sys.exit(main())
"""
# Bars and lines of progress, which depend on the clock.
PROGRESS = r"[^\r\n]*(?:\d+%\||, \d+ simulations|groups done, )[^\r\n]*[\r\n]+"
COMMANDS = (
    "add", "calibrate", "check", "config", "demo", "diagnose", "distinguish", "hammer", "nightly", "passage", "plan",
    "query", "export", "events", "acknowledge", "blind", "worklist", "real", "registry", "report", "simulate", "trains",
    "config show", "config generate", "blind make", "blind diagnose", "blind reveal", "blind score", "blind keep",
    "simulate hammer", "simulate passage", "simulate figures",
)  # fmt: skip
# Asked in this order in the folder of the fleet after its nightly run; {PATTERN:N} is the N-th file of a pattern.
ASKED = (HERE / "asked.txt").read_text(encoding="utf-8")


class Recording:
    """Folder of the results of one run of the program, and the way to start the program."""

    def __init__(self, out, src, tier):
        self.out, self.src = Path(out).resolve(), Path(src).resolve()
        self.places = self.out / f"run_{tier}"
        self.files, self.repository = self.out / "files", self.src.parent
        where = f"{HERE / 'pinned'}{os.pathsep}{self.src}"
        self.environment = os.environ | {
            "PYTHONPATH": where, "TURNOUT_GOLDEN": "1", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1",
            "COLUMNS": "100", "TZ": "UTC", "PYTHONHASHSEED": "0",
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        }  # fmt: skip
        self.files.mkdir(parents=True, exist_ok=True)
        found = self.run(["-c", "import turnout; print(turnout.__file__)"], self.files)[1].strip()
        if not Path(found).is_relative_to(self.src):
            sys.exit(f"the program is taken from {found}, not from {self.src}")

    def run(self, words, folder):
        """(exit code, standard output, standard error) of Python with ``words``."""
        done = subprocess.run(
            [sys.executable, *map(str, words)], cwd=folder, env=self.environment, text=True, capture_output=True,
            stdin=subprocess.DEVNULL, check=False,
        )  # fmt: skip
        return done.returncode, done.stdout, done.stderr

    def command(self, words, folder, name):
        """Store the output of ``turnout`` with the arguments ``words``."""
        before = _cpu()
        code, out, err = self.run(["-c", MAIN, *words], folder)
        with open(self.out / "cpu.txt", "a") as file:
            file.write(f"{_cpu() - before:6.1f} s {name}\n")
        err = re.sub(PROGRESS, "", err)
        self.keep(name, f"$ turnout {shlex.join(words)}\n{out}--- stderr\n{err}--- exit code {code}\n")
        return out

    def keep(self, name, content):
        """Write a text without the folders of this run, or bytes."""
        path = self.files / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(content, str):
            for place, word in (
                (self.places, "<run>"),
                (self.out, "<out>"),
                (self.src, "<src>"),
                (self.repository, "<repository>"),
            ):
                content = content.replace(str(place), word)
            content = content.encode()
        path.write_bytes(content)

    def keep_files(self, folder, pattern, name):
        """Store the files of a folder; pages and texts without folders and hashes of content."""
        for path in sorted(p for p in folder.glob(pattern) if p.is_file()):
            content = path.read_bytes()
            if path.suffix in (".html", ".csv", ".json", ".svg", ".yaml", ".tsv", ".md"):
                content = re.sub(r'<meta name="turnout-content" content="\w+">', "", content.decode())
            self.keep(f"{name}/{path.relative_to(folder)}", content)

    def place(self, name):
        """A working copy of the inputs ``name``."""
        folder = self.places / name
        shutil.rmtree(folder, ignore_errors=True)
        shutil.rmtree(self.files / name, ignore_errors=True)
        return Path(shutil.copytree(INPUTS / name, folder))

    def workflow(self, folder, name, *more, nightly=False, settings=()):
        """Run the whole workflow on one core; store registry, trends, worklist and pages."""
        snakefile = self.repository / "Snakefile"
        options = ["--snakefile", snakefile, "--cores", 1, *more, "--config", f"day={DAY}", "shards=1", *settings]
        profile = ["nightly", "--profile", self.repository / "profiles/default", "--"]
        start = ["-c", MAIN, *profile] if nightly else ["-m", "snakemake"]
        code, out, err = self.run([*start, *options], folder)
        (folder / "workflow.log").write_text(out + err)
        summary_lines = re.findall(r"^(?:\w+ \S+: \d+ known|register: |ok: |failed |every job ).*", out + err, re.M)
        self.keep(f"{name}/workflow.txt", "\n".join([*summary_lines, f"exit code {code}\n"]))
        self.keep_files(folder / "work", "*/*.done", f"{name}/work")
        self.keep_files(folder / "work", "verdict.json", f"{name}/work")
        results = folder / "results"
        self.keep_files(results / "registry", "**/*.parquet", f"{name}/parquet")
        self.keep_files(results, "*.csv", f"{name}/results")
        self.keep_files(results / "pages", "**/*", f"{name}/pages")
        self.rows(results / "registry/registry.duckdb", f"{name}/rows")

    def rows(self, database, name):
        """All rows of every table and view of the registry, sorted."""
        if not database.exists():
            return
        with duckdb.connect(str(database), read_only=True) as con:
            con.execute("set threads = 1")
            con.execute("set timezone = 'UTC'")
            for (table,) in con.execute("select table_name from information_schema.tables order by all").fetchall():
                self.keep(f"{name}/{table}.tsv", _rows(con, f'"{table}"'))


def fleet(rec):
    """Three turnouts of the demonstration fleet, few sections, through all stages; then the commands."""
    folder = rec.place("fleet")
    rec.workflow(folder, "fleet", nightly=True)
    for k, line in enumerate(filter(None, ASKED.splitlines())):
        words = [_file(folder, word) for word in shlex.split(line)]
        rec.command(words, folder, f"fleet/asked/{k + 1:02d} {re.sub(r'[^a-z0-9]+', '_', line.lower())[:40]}.txt")
    rec.keep_files(folder, "ot.svg", "fleet/asked")
    with duckdb.connect() as con:  # exports have no order
        for path in sorted((folder / "exported").iterdir()):
            rec.keep(f"fleet/exported/{path.name}.tsv", _rows(con, f"'{path}'"))
    for made in ("asked_pages", "simulated", "config"):
        rec.keep_files(folder / made, "**/*", f"fleet/{made}")
    rec.rows(folder / "results/registry/registry.duckdb", "fleet/rows_compacted")


def _rows(con, table):
    """Rows of a table or file as text, sorted."""
    found = con.execute(f"select * from {table}")
    columns = "\t".join(c for c, *_ in found.description)
    return "\n".join([columns, *sorted("\t".join(map(repr, row)) for row in found.fetchall()), ""])


def _file(folder, word):
    """``{pattern:n}`` is the n-th file."""
    if not word.startswith("{"):
        return word
    pattern, _, n = word[1:-1].rpartition(":")
    return str(sorted(folder.glob(pattern))[int(n)].relative_to(folder))


def toy(rec):
    """Thirty-six tiny files, ten of them damaged in ten ways."""
    folder = rec.place("toy")
    rec.workflow(folder, "toy")
    rec.command(["worklist"], folder, "toy/worklist.txt")


def helps(rec):
    """The help of every command, and the page of effects."""
    shutil.rmtree(rec.files / "help", ignore_errors=True)
    for words in ("", *COMMANDS):
        rec.command([*words.split(), "--help"], rec.out, f"help/{words.replace(' ', '_') or 'turnout'}.txt")
    for path in sorted((rec.src / "turnout").glob("**/effects_page.py")):
        module = ".".join(path.relative_to(rec.src).with_suffix("").parts)
        (rec.places / "docs").mkdir(parents=True, exist_ok=True)
        rec.run(["-m", module, rec.places / "docs"], rec.out)
        rec.keep_files(rec.places / "docs", "*.md", "help")


def small(rec):
    """A small turnout, whose soft pad is diagnosed by the workflow."""
    folder = rec.place("small")
    rec.workflow(folder, "small", settings=["diagnose=true"])


def demo(rec):
    """One campaign of all sections of the demonstration fleet."""
    folder = rec.place("demo")
    rec.workflow(folder, "demo")
    words = "calibrate --track tommerup --section A7 --modes ballast=99.6/0.292 railpad=616.4/0.066"
    rec.command(words.split(), folder, "demo/calibrate_modes.txt")
    words = "calibrate --turnout tommerup_s2 --section A8 {raw/tommerup_s2/hammer/*/A8_*:0}"
    rec.command([_file(folder, word) for word in words.split()], folder, "demo/calibrate_tests.txt")


def blind(case):
    """The diagnosis of a case of the stored blind set."""

    def diagnosed(rec):
        folder, name = rec.place(f"blind/{case}"), f"blind/{case}"
        rec.command(["diagnose", "--turnout", case, "--visit", "all", "--work", "work"], folder, f"{name}/answers.txt")
        rec.keep_files(folder / "results/pages", "**/*", f"{name}/pages")

    return diagnosed


def items(tier):
    """name -> function, in order."""
    if tier == "quick":
        return {"help": helps, "toy": toy, "small": small, "fleet": fleet}
    return {"demo": demo} | {f"blind/{p.name}": blind(p.name) for p in sorted((INPUTS / "blind").iterdir())}


def record(args):
    """Record a tier and write its list of hashes."""
    rec = Recording(args.out, args.src, args.tier)
    chosen = {name: job for name, job in items(args.tier).items() if not args.only or name in args.only}
    for name, job in chosen.items():
        before = _cpu()
        job(rec)
        print(f"{name}: {_cpu() - before:.0f} CPU s", flush=True)
    lines = [
        f"{path.relative_to(rec.files)}  {hashlib.sha256(path.read_bytes()).hexdigest()}"
        for name in items(args.tier) for path in (rec.files / name).glob("**/*") if path.is_file()
    ]  # fmt: skip
    (rec.out / f"{args.tier}.sha256").write_text("\n".join(sorted(lines)) + "\n")
    print(f"{rec.out}/{args.tier}.sha256: {len(lines)} files, {_cpu():.0f} CPU s in all")
    if not args.keep_run:
        shutil.rmtree(rec.places, ignore_errors=True)


def _cpu():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def compare(args):
    """Print the differences between two recordings, tier by tier; the exit code is 1 if there are any."""
    worst = 0
    for tier in ("quick", "full"):
        lists = [Path(side) / f"{tier}.sha256" for side in (args.a, args.b)]
        if not all(path.exists() for path in lists):
            print(f"{tier}: not recorded in both")
            continue
        a, b = (dict(line.rsplit("  ", 1) for line in path.read_text().splitlines()) for path in lists)
        differing = [name for name in sorted(a.keys() | b.keys()) if a.get(name) != b.get(name)]
        print(f"{tier}: {len(a.keys() | b.keys())} files, {len(differing)} differ")
        for name in differing:
            print(f"  {name}" + ("" if name in a and name in b else f": only in {args.a if name in a else args.b}"))
            if name in a and name in b:
                _show(Path(args.a) / "files" / name, Path(args.b) / "files" / name, args.lines)
        worst |= bool(differing)
    return worst


def _show(a, b, n):
    """Print the first lines in which two texts differ."""
    try:
        texts = [path.read_text().splitlines() for path in (a, b)]
    except UnicodeDecodeError:
        print("    (not text)")
        return
    changed = [line for line in difflib.unified_diff(*texts, n=0, lineterm="") if line[:3] not in ("---", "+++")]
    for line in changed[:n]:
        print(f"    {line[:300]}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    steps = parser.add_subparsers(dest="step", required=True)
    one = steps.add_parser("record")
    one.add_argument("out")
    one.add_argument("--tier", choices=("quick", "full"), default="quick")
    one.add_argument(
        "--src", default=HERE.parents[1] / "src", help="folder with the package; its Snakefile lies beside"
    )
    one.add_argument("--only", nargs="+", help="only these items, as fleet toy small help")
    one.add_argument("--keep-run", action="store_true", help="leave the working folders")
    two = steps.add_parser("compare")
    two.add_argument("a")
    two.add_argument("b")
    two.add_argument("--lines", type=int, default=6, help="differing lines shown per file (6)")
    args = parser.parse_args()
    sys.exit(record(args) if args.step == "record" else compare(args))


if __name__ == "__main__":
    main()
