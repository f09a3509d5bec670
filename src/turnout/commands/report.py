"""Write the pages of a registry: one for the fleet, one for each turnout.

turnout report                       all pages
turnout report --turnouts tommerup_s1 tommerup_s2
"""

HELP = "write the pages of fleet and turnouts"


def add_arguments(parser):
    """Options of the command."""
    parser.add_argument("--registry", default="results/registry", help="folder of the registry (%(default)s)")
    parser.add_argument("--pages", default="results/pages", help="where the pages go (%(default)s)")
    parser.add_argument(
        "--turnouts", "--turnout", nargs="+", metavar="ID", help="only these turnouts' pages, and the fleet's"
    )
    parser.add_argument("--cores", type=int, default=1, help="processes that draw pages (%(default)s)")


def run(args):
    """Write the pages and say where they are."""
    from turnout.report.job import report_job

    n = report_job(args.registry, args.pages, args.turnouts, threads=args.cores)
    print(f"{n} pages written, the others had not changed: {args.pages}/index.html")
