"""Calibrate the sensors for axle loads, and find clusters of similar passages, from the trains so far.

  turnout trains                           all turnouts: calibrate loads, find clusters
  turnout trains --turnout tommerup_s1     loads of this turnout only, and clusters

Loads need trains of known weight (axle_load_t in raw/<id>/trains.csv). Both results are written into the folder of the
setting passage.assets. The next run uses them, and computes the passages that depend on them again.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.cli.input_warnings import input_warnings
from turnout.cli.options import (
    add_configuration,
    add_raw,
    add_registry,
    add_result,
    add_turnouts,
    add_use,
    add_warnings,
)
from turnout.constants import KMH
from turnout.counts import count_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from turnout.config.settings.passage import PassageSettings
    from turnout.passage.axle_load import LoadCalibration
    from turnout.passage.clusters import Clusters

GROUP = "Run"
HELP = "calibrate axle loads and find clusters, from the trains so far"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The turnouts, and the folders of configuration, recordings and registry.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    add_turnouts(parser, "only the loads of these turnouts")
    add_configuration(parser)
    add_raw(parser)
    add_registry(parser)


def run(args: argparse.Namespace) -> int:
    """Print each calibration and each cluster.

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
        The raw folder is absent.
    """
    from turnout.config import load_configuration, with_raw
    from turnout.errors import ConfigError
    from turnout.registry.database import open_registry
    from turnout.stages.passage_context import known_patterns
    from turnout.stages.passage_training import learn_clusters, learn_loads, weighed_trains

    if not Path(args.raw).is_dir():
        raise ConfigError("--raw", "folder of the recordings", f"there is no folder {args.raw}", "Name the one that is")
    configuration = load_configuration(args.configuration)
    names = args.turnouts or list(configuration.rows)
    settings = configuration.settings["passage"]
    for name in names:
        add_warnings(args, input_warnings(configuration, name, args.raw))
    with open_registry(args.registry):
        pass  # without one there are no clusters: an error before anything is computed
    has_result = []  # of each turnout, then of the clusters
    loads: list[dict[str, Any]] = []
    for name in names:
        turnout = with_raw(configuration.turnout(name), args.raw)
        if turnout.passages is None:
            continue
        settings = turnout.settings["passage"]
        patterns = known_patterns(settings.axle_patterns)
        trains = weighed_trains(turnout, args.raw, patterns, settings)
        calibrations = learn_loads(turnout, trains, settings)
        has_result.append(bool(calibrations))
        loads += [_load_row(name, channel, c) for channel, c in calibrations.items()]
        print("\n".join(_load_lines(name, trains, calibrations, settings)))
    with open_registry(args.registry) as connection:
        clusters = learn_clusters(connection, settings)
    has_result.append(bool(clusters.clusters))
    print("\n".join(_cluster_lines(clusters)))
    add_result(args, {"loads": loads, "clusters": _cluster_rows(clusters)})
    add_use(args, sum(has_result), has_result.count(False))
    return 0


def _load_row(turnout_id: str, channel: str, calibration: LoadCalibration) -> dict[str, Any]:
    """The calibration of one sensor as numbers."""
    c = calibration
    return {
        "turnout_id": turnout_id, "channel": channel, "scatter_pct": 100.0 * c.scatter, "speed_exponent": c.exponent,
        "slowest_kmh": KMH * c.slowest, "fastest_kmh": KMH * c.fastest, "n": c.n, "train_types": c.types,
    }  # fmt: skip


def _cluster_rows(clusters: Clusters) -> list[dict[str, Any]]:
    """The clusters as numbers."""
    import numpy as np

    rows = []
    for c in clusters.clusters:
        centre = np.exp(c.mean)
        load = float(centre[1]) if len(centre) > 1 else None
        rows.append({"cluster_id": c.id, "speed_kmh": float(centre[0]), "axle_load_t": load, "n": c.n})
    return rows


def _load_lines(
    name: str,
    trains: Sequence[Mapping[str, Any]],
    calibrations: Mapping[str, LoadCalibration],
    settings: PassageSettings,
) -> list[str]:
    """The calibrations of one turnout in words."""
    n_trains = f"{count_of(len(trains), 'train')} of known weight"
    if not calibrations:
        n_required = settings.load_trains_minimum
        return [f"{name}: {n_trains}, {n_required} are needed: axle loads stay unavailable"]
    lines = [f"{name}: {n_trains}, {min(t['load'] for t in trains):.1f} to "]
    lines[0] += f"{max(t['load'] for t in trains):.1f} t per axle"
    for channel, c in calibrations.items():
        lines.append(
            f"  {channel:<6} trains scatter by {100 * c.scatter:.1f} % (sd) beyond their own errors, "
            f"amplitude with speed to the power "
            f"{c.exponent:.2f}, {KMH * c.slowest:.0f} to {KMH * c.fastest:.0f} km/h, n = {c.n}"
        )
    return lines


def _cluster_lines(clusters: Clusters) -> list[str]:
    """The clusters in words."""
    lines = [f"clusters, version {clusters.version}:"]
    for row in _cluster_rows(clusters):
        load = "" if row["axle_load_t"] is None else f", {row['axle_load_t']:.1f} t per axle"
        lines.append(f"  {row['cluster_id']:<14}{row['speed_kmh']:.0f} km/h{load}, n = {row['n']}")
    return lines if clusters.clusters else ["no clusters: no train of a known type yet"]
