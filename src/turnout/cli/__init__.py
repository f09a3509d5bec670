"""The commands of the program, one file each. A new command is a new file and one line in this list.

Each module has GROUP (one of ``GROUPS``), HELP (one line), add_arguments(parser) and run(args) -> exit code. It imports
what it needs inside run, so that ``turnout --help`` starts at once. ``add_result(args, rows)`` of ``options`` hands on
what ``--json`` prints beside the text.
"""

GROUPS: tuple[str, ...] = ("Set up", "Look at recordings", "Run", "Ask", "Simulate and diagnose", "Try")

COMMANDS: tuple[str, ...] = (
    "add",
    "alert",
    "calibrate",
    "check",
    "compare",
    "completion",
    "config",
    "demo",
    "diagnose",
    "distinguish",
    "hammer",
    "init",
    "inspect",
    "layout",
    "nightly",
    "paper",
    "passage",
    "plan",
    "query",
    "export",
    "events",
    "acknowledge",
    "blind",
    "worklist",
    "real",
    "registry",
    "report",
    "simulate",
    "trains",
    "twin",
)
