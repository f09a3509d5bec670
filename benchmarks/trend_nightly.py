"""Run one nightly update in its own process and print CPU seconds and peak memory as JSON."""

import json
import resource
import sys
import time


def main(registry, state) -> None:
    """Update the registry, then query the work list. Both are timed, with the imports."""
    from pathlib import Path

    from turnout.config.settings.trend import TrendSettings
    from turnout.registry.database import open_registry
    from turnout.trend.update import update

    digests = json.loads(Path(state).read_text()) if Path(state).exists() else None
    result = update(registry, TrendSettings(), digests)
    updated = time.process_time()
    with open_registry(registry) as con:
        n = len(con.execute("select * from worklist").fetchall())
    Path(state).write_text(json.dumps(result.digests))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
    print(json.dumps({"cpu": time.process_time(), "worklist": time.process_time() - updated, "peak": peak,
                      "rows": result.rows, "written": result.written, "n": n}))  # fmt: skip


if __name__ == "__main__":
    main(*sys.argv[1:])
