"""The commands of the program, one file each. A new command is a new file and one line in this list.
``turnout --help`` shows them by group in this order, which is that of use.

Each module has GROUP (one of ``GROUPS``), HELP (one line), add_arguments(parser) and run(args) -> exit code. It imports
what it needs inside run, so that ``turnout --help`` starts at once. ``add_result(args, rows)`` of ``options`` hands on
what ``--json`` prints beside the text.
"""

GROUPS: tuple[str, ...] = (
    "Set up",
    "Look at recordings",
    "Run",
    "Worklist and maintenance",
    "Results",
    "Simulate and diagnose",
    "Examples",
)

COMMANDS: tuple[str, ...] = (
    "init",
    "layout",
    "add",
    "check",
    "config",
    "completion",
    "inspect",
    "hammer",
    "passage",
    "nightly",
    "plan",
    "trains",
    "report",
    "worklist",
    "acknowledge",
    "events",
    "alert",
    "query",
    "export",
    "paper",
    "registry",
    "simulate",
    "calibrate",
    "compare",
    "distinguish",
    "diagnose",
    "twin",
    "blind",
    "demo",
    "real",
)
