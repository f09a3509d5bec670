"""Run the benchmarks named on the command line, or all of them, and print figure beside bar."""

import argparse
import ast
import os
import platform
import sys
from importlib import import_module
from pathlib import Path

from benchmarks.bar import heading

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")


def main() -> int:
    """Each module ``bench_<part>`` has ``bars()``, a generator of ``Bar``."""
    texts = {
        path.stem.removeprefix("bench_"): (
            ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        ).replace("``", "")
        for path in sorted(Path(__file__).parent.glob("bench_*.py"))
    }
    available = list(texts)
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description=__doc__,
        epilog="parts:\n"
        + "\n".join(f"  {name:<15} {text.splitlines()[0]}" for name, text in texts.items())
        + "\n\nEach part prints first what it measures, and the variables that make it shorter. All parts take hours.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("part", nargs="*", metavar="part", help="parts to run (all of them)")
    parser.add_argument("--strict", action="store_true", help="exit code 1 where a bar is missed; 0 without it")
    parser.add_argument("--seeds", metavar="N", help="faults: number of seeds (20)")
    parser.add_argument("--first", metavar="SEED", help="faults and mutations: first seed (0)")
    parser.add_argument("--files", metavar="N", help="mutations: number of files (2400)")
    args = parser.parse_args()
    environment = {
        "TURNOUT_FAULT_SEEDS": args.seeds,
        "TURNOUT_FIRST_SEED": args.first,
        "TURNOUT_MUTATED_FILES": args.files,
    }
    for name, value in environment.items():
        if value is not None:
            os.environ[name] = value
    names = args.part or available
    if unknown := set(names) - set(available):
        parser.error(f"no benchmark {', '.join(sorted(unknown))}; there are {', '.join(available)}")
    print(f"Python {platform.python_version()}, {os.cpu_count()} cores, one BLAS thread. CPU s = user + system.")
    missed = unmeasured = 0
    for name in names:
        module = import_module(f"benchmarks.bench_{name}")
        print(f"\n{name}\n{'-' * len(name)}\n{texts[name]}\n\n{heading()}", flush=True)
        for bar in module.bars():
            print(bar, flush=True)
            missed += bar.is_met is False
            unmeasured += bar.is_unmeasured
    print(f"\n{missed or 'No'} bar{'s' * (missed > 1)} missed{f', {unmeasured} not measured' if unmeasured else ''}.")
    return 1 if args.strict and missed else 0


if __name__ == "__main__":
    sys.exit(main())
