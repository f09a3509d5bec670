"""Find the clusters of the demonstration's trains from their train data, before any passage was analysed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.config import load_configuration, with_raw
from turnout.files import write_if_changed
from turnout.passage.clusters import fit_clusters
from turnout.passage.timetable import listed_trains

if TYPE_CHECKING:
    from turnout.passage.clusters import Clusters


def write_clusters(raw: Path | str, configuration: Path | str = "config") -> Clusters:
    """Clusters of all trains in the train data of the turnouts, as ``turnout trains`` finds them from the registry.

    Parameters
    ----------
    raw : path
        Raw root.
    configuration : path
        Folder of the configuration.

    Returns
    -------
    Clusters
        The clusters, written to the folder that the setting ``passage.assets`` names.
    """
    loaded = load_configuration(configuration)
    settings = loaded.settings["passage"]
    rows = []
    for name in loaded.rows:
        trains, _ = listed_trains(with_raw(loaded.turnout(name), Path(raw)).trains)
        rows += [{"train_type": t.train_type, "speed_kmh": t.speed, "axle_load_t": t.axle_load} for t in trains]
    clusters = fit_clusters(rows, settings)
    write_if_changed(Path(settings.assets) / "clusters.json", json.dumps(clusters.document(), indent=1) + "\n")
    return clusters
