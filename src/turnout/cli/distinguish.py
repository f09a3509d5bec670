"""Show which effects a planned campaign can distinguish, and which further measurement would add most.

turnout distinguish --track tommerup --sensor-positions 23.4 26.4 --impact-positions 24.6 --temperatures 5 25
turnout distinguish --track tommerup --sensor-positions 23.4 26.4 --vehicles ic3 --speeds 160 100

A figure is the evidence [nats] that is lost if the effect of the row is explained by that of the column, with the best
size of the latter and all nuisance parameters free. The columns have the numbers of the rows; "none" is the base model.
Below 5 nats two effects cannot be distinguished. A name needs 12 in the column "none" and 6 against each other effect.
Each effect has the size from which a diagnosis begins to fit it, in the middle of its possible positions.
"""

import argparse

from turnout.cli.option_types import RAIL_TEMPERATURE, SPEED, finite_number
from turnout.cli.options import add_configuration, add_former, add_result, add_track, add_warnings

GROUP = "Simulate and diagnose"
HELP = "show which effects a planned campaign can distinguish"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    add_track(parser, help="file in config/tracks (%(default)s)", default="tommerup")
    add_configuration(parser)
    parser.add_argument(
        "--sensor-positions", nargs="+", type=finite_number, required=True, metavar="M", help="positions of sensors [m]"
    )
    parser.add_argument(
        "--impact-positions", nargs="+", type=finite_number, default=(), metavar="M", help="positions of impacts [m]"
    )
    for former, present in (
        ("--sensors", "--sensor-positions"),
        ("--impacts", "--impact-positions"),
        ("--blows", "--impact-positions"),
    ):
        add_former(parser, former, present, nargs="+", type=finite_number)
    parser.add_argument(
        "--temperatures", nargs="+", type=RAIL_TEMPERATURE, default=(15.0,), metavar="C", help="of the rail [°C]"
    )
    parser.add_argument("--vehicles", nargs="+", default=(), metavar="NAME", help="files in config/vehicles")
    add_former(parser, "--trains", "--vehicles", nargs="+")
    parser.add_argument("--speeds", nargs="+", type=SPEED, default=(160.0,), metavar="KMH", help="[km/h]")
    parser.add_argument("--effects", nargs="+", metavar="EFFECT", help="only these effects")
    add_former(parser, "--families", "--effects", nargs="+")


def run(args: argparse.Namespace) -> int:
    """Print the matrix, the confused effects, and the addition that would resolve most.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.
    """
    from turnout.config.settings.mismatch import MismatchSettings
    from turnout.mismatch.engine.thresholds import THRESHOLDS
    from turnout.stages.distinguish import planned_files, planned_matrix
    from turnout.stages.parameter_ranges import improbable_in_files

    add_warnings(args, improbable_in_files(planned_files(args.track, args.vehicles, args.configuration)))
    matrix, advice = planned_matrix(
        args.track,
        args.sensor_positions,
        args.impact_positions,
        args.temperatures,
        args.vehicles,
        args.speeds,
        args.effects,
        args.configuration,
    )
    print(matrix)
    confused = {name: matrix.confused_with(name) for name in matrix.names}
    unseen = [name for name, rivals in confused.items() if "none" in rivals]
    if unseen:
        print(f"cannot be seen (below {THRESHOLDS.min_evidence:g} nats in the column none): {', '.join(unseen)}")
    for name, rivals in confused.items():
        if rivals and name not in unseen:
            print(f"{name} cannot be distinguished from {', '.join(rivals)}")
    settings = MismatchSettings()
    nameable = [n for n in matrix.names if matrix.can_be_named(n, settings.threshold, settings.margin)]
    print(f"enough evidence for a name: {', '.join(nameable) or 'no effect'}")
    print(advice)
    rows = [
        {"effect": name, "evidence_nats": float(nats), "confused_with": confused[name], "is_named": name in nameable}
        for name, nats in zip(matrix.names, matrix.detectability)
    ]
    add_result(args, rows)
    return 0
