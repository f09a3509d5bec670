"""Send new entries of the worklist by mail and webhook, each once, with what to look at first.

turnout alert               send what is new; `turnout nightly` does it after each run
turnout alert --dry-run     print the text for the whole worklist of today, send nothing

Addresses are in the section alerts of config/config.yaml. Two secrets are in the environment: TURNOUT_SMTP_PASSWORD for
the mail server, TURNOUT_WEBHOOK for a webhook whose address is secret. What was sent is noted in work/alerts.json.
"""

import argparse

from turnout.cli.options import add_configuration, add_registry, add_result

GROUP = "Worklist and maintenance"
HELP = "send new entries of the worklist by mail and webhook"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Folders, and whether to send.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    add_registry(parser)
    add_configuration(parser)
    parser.add_argument("--dry-run", action="store_true", help="print the text for the whole worklist, send nothing")


def run(args: argparse.Namespace) -> int:
    """Send and print the number of new entries; TurnoutError if a server does not take them.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.

    Raises
    ------
    ConfigError
        The settings name neither recipients nor a webhook.
    """
    from turnout.config import load_configuration
    from turnout.errors import ConfigError
    from turnout.workflow.alerts import message_text, send_new_entries, worklist_entries

    settings = load_configuration(args.configuration).settings["alerts"]
    if args.dry_run:
        entries = worklist_entries(args.registry)
        add_result(args, entries)
        print(message_text(entries) if entries else "No entry asks for an action.")
        return 0
    counts = send_new_entries(args.registry, settings)
    if not counts:
        problem = "neither recipients nor webhook"
        raise ConfigError(f"{args.configuration}/config.yaml", "alerts", problem, "Write one of them, or both")
    add_result(args, counts)
    print("; ".join(f"{channel}: {n} new" for channel, n in counts.items()))
    return 0
