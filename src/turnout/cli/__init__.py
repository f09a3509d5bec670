"""The commands of the program, one file each. A new command is a new file and one line in this list.

Each module has HELP (one line), add_arguments(parser) and run(args) -> exit code; it imports what it needs
inside run, so that ``turnout --help`` starts at once.
"""

COMMANDS: tuple[str, ...] = (
    "add",
    "calibrate",
    "check",
    "config",
    "demo",
    "diagnose",
    "distinguish",
    "hammer",
    "init",
    "inspect",
    "layout",
    "nightly",
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
)
