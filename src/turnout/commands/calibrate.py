"""Fit pads, ballast and damping of a section to its hammer tests, and say what the data cannot tell.

  turnout calibrate --track tommerup --section A7 --turnout tommerup_s1 raw/tommerup_s1/hammer/2024-05-13/A7_*.h5
  turnout calibrate --track tommerup --section A7 --modes ballast=99.6/0.292 railpad=616.4/0.066

The first meets the measured receptance line by line (gradients, priors, covariance); the second looks for
parameters whose simulated test has these resonances [Hz] and damping ratios. Nothing is changed on disk: the values
are printed as they stand in the track's file.
"""

HELP = "fit a simulated section to measured receptances"
UNITS = {
    "pad_stiffness": ("MN/m", 1e6),
    "pad_damping": ("kN s/m", 1e3),
    "ballast_stiffness": ("MN/m", 1e6),
    "ballast_damping": ("kN s/m", 1e3),
    "sleeper_mass": ("kg", 1.0),
}


def add_arguments(parser):
    """Options of the command."""
    parser.add_argument("files", nargs="*", help="hammer tests of the section")
    parser.add_argument("--track", default="tommerup", help="file in config/tracks, or its path")
    parser.add_argument("--section", required=True, help="section of the track file")
    parser.add_argument("--turnout", help="id in config/turnouts.tsv, for the channels of the files")
    parser.add_argument("--configuration", "--config", default="config", help="configuration folder (default config)")
    parser.add_argument("--modes", nargs="+", metavar="BAND=HZ/ZETA", help="resonances to meet instead of files")


def run(args):
    """Fit and print."""
    from turnout.chains.calibrate import calibrate_to_files, calibrate_to_modes
    from turnout.errors import SimulationError

    if bool(args.files) == bool(args.modes):
        raise SimulationError("give either hammer tests or --modes.")
    if args.modes:
        fit = calibrate_to_modes(args.track, args.section, _wanted(args.modes))
        for band, (frequency, damping) in fit.wanted.items():
            got = fit.found.get(band)
            reached = f"{got[0]:.1f} Hz, {got[1]:.4f}" if got else "not found"
            print(f"{band}: wanted {frequency:.1f} Hz, {damping:.4f}; reached {reached}")
        values, sd = fit.values, {}
    else:
        found = calibrate_to_files(args.track, args.section, args.files, args.turnout, args.configuration)
        print(found)
        values, sd = found.values, found.sd
    print(f"\n  # section {args.section}")
    for name, value in values.items():
        unit, factor = UNITS[name]
        prior = f", prior: {sd[name]:.2g}" if name in sd else ""
        print(f'    {name}: {{value: {value / factor:.4g}, unit: {unit}, source: "estimate: fitted"{prior}}}')
    return 0


def _wanted(modes):
    from turnout.errors import SimulationError

    wanted = {}
    for mode in modes:
        try:
            band, rest = mode.split("=")
            frequency, damping = (float(v) for v in rest.split("/"))
        except ValueError:
            raise SimulationError(f"--modes {mode!r} is not of the form ballast=99.6/0.292.") from None
        wanted[band] = (frequency, damping)
    return wanted
