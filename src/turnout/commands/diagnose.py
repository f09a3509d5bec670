"""Say what the simulation of a turnout leaves out, from its hammer tests and passages.

turnout diagnose --turnout tommerup_s1
turnout diagnose --turnout tommerup_s1 --sections A7 A8 --json

An interrupted diagnosis goes on where it stopped: its fits are kept below --work until it is done.
"""

HELP = "say what the simulation of a turnout leaves out"


def add_arguments(parser):
    """Options of the command."""
    parser.add_argument("--turnout", required=True, help="id in config/turnouts.tsv")
    parser.add_argument("--sections", nargs="+", default=(), help="only these sections, which should be neighbours")
    parser.add_argument("--track", help="file in config/tracks; default: the name of the layout")
    parser.add_argument("--config", default="config", help="configuration folder (%(default)s)")
    parser.add_argument("--raw", default="raw", help="folder of raw files (%(default)s)")
    parser.add_argument("--work", default="work/mismatch", help="where an interrupted diagnosis is kept (%(default)s)")
    parser.add_argument("--json", action="store_true", help="print the registry row instead of words")


def run(args):
    """Diagnose and print."""
    import json
    from pathlib import Path

    from tqdm import tqdm

    from turnout.chains.checkpoint import Checkpoint
    from turnout.chains.mismatch import diagnose_turnout
    from turnout.fingerprint import fingerprint

    store = Checkpoint(Path(args.work), args.turnout, (*args.sections, fingerprint("turnout.chains.mismatch")))
    with tqdm(total=None, unit="fit", disable=None) as bar:

        def progress(done, total, what):
            bar.total = total
            bar.set_description(what[:40])
            bar.update(done - bar.n)

        diagnosis, row, notes = diagnose_turnout(
            args.turnout, args.config, args.raw, args.track, tuple(args.sections), progress, store
        )
    for note in notes:
        print(f"left out: {note}")
    print(json.dumps(row, default=str, indent=1) if args.json else _words(diagnosis, row))
    store.done()
    return 0


def _words(diagnosis, row):
    verdict, check = diagnosis.verdict, diagnosis.verification
    lines = [f"{verdict.answer} {verdict.grade}".strip() + f", probability {verdict.probability:.2f}", row["sentence"]]
    if check.n:
        said = {"before": check.before, "after": check.after, "rival": check.rival, "decoy": check.decoy}
        shown = ", ".join(f"{k} {v:.1f} %" for k, v in said.items() if v is not None)
        lines.append(f"fit on {check.n} recordings never used: {shown}")
    if row["next_measurement"]:
        lines.append(row["next_measurement"] + ".")
    return "\n".join(lines)
