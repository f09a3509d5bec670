"""Models, axle patterns, clusters and load calibrations that the passages of one turnout are judged with."""

from __future__ import annotations

import hashlib
import json
from datetime import datetime
from functools import lru_cache
from pathlib import Path

import numpy as np
from ruamel.yaml import YAML

from turnout.chains.passage import PassageContext, SectionModel
from turnout.config.settings.passage import PassageSettings
from turnout.content import sha256_of
from turnout.errors import ConfigError
from turnout.fleet.batches import read_results
from turnout.fleet.state import batch_paths
from turnout.passage.clusters import Clusters
from turnout.passage.load import LoadCalibration
from turnout.passage.patterns import read_patterns
from turnout.records import ModalModel


def passage_context(turnout: str, work="work", settings: PassageSettings | None = None) -> tuple[str, PassageContext]:
    """(token, context) of one turnout: the token changes when a model, a pattern, a cluster or a calibration does.

    Models are read from what the hammer stage left in ``work``; a passage is fitted with the latest one identified
    before it, so a new campaign changes the scores of later passages only.
    """
    settings = settings or PassageSettings()
    models = section_models(turnout, work)
    clusters = read_clusters(Path(settings.assets) / "clusters.json")
    loads = read_loads(Path(settings.assets) / "loads.json").get(turnout, {})
    parts = [sorted(m.model_id for found in models.values() for m in found), _digest(settings.axle_patterns)]
    parts += [_digest(Path(settings.assets) / name) for name in ("clusters.json", "loads.json")]
    token = hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]
    return token, PassageContext(models, known_patterns(settings.axle_patterns), clusters, loads)


def section_models(turnout: str, work="work") -> dict[str, tuple[SectionModel, ...]]:
    """Accepted models of each section, by label, in order of time."""
    found: dict[str, list[SectionModel]] = {}
    for path in batch_paths(sorted((Path(work) / "hammer").glob("*.json"))):
        for result in read_results(path):
            if result.turnout != turnout:
                continue
            for row in result.tables.get("models", []):
                if row["status"] in ("accepted", "second_order_only"):
                    label = row["section_id"].removeprefix(f"{turnout}/")
                    found.setdefault(label, []).append(_section_model(row))
    unique = {label: {m.model_id: m for m in models}.values() for label, models in found.items()}
    return {label: tuple(sorted(ms, key=lambda m: (m.measured_at, m.model_id))) for label, ms in unique.items()}


def _section_model(row) -> SectionModel:
    n = int(row["model_order"])
    a = np.asarray(row["a_matrix"], float).reshape(n, n)
    b, c = np.asarray(row["b_vector"], float), np.asarray(row["c_vector"], float)
    model = ModalModel(a, b, c, float(row["sampling_rate_hz"]), (), row["method"], row["status"])
    moment = row["measured_at_utc"]
    moment = moment if isinstance(moment, datetime) else datetime.fromisoformat(str(moment))
    return SectionModel(row["model_id"], moment, model)


@lru_cache(maxsize=4)
def known_patterns(path: str):
    """Axle patterns of a YAML file, () where there is none; ConfigError where it cannot be used."""
    if not Path(path).is_file():
        return ()
    try:
        return read_patterns(YAML(typ="safe").load(Path(path)))
    except (KeyError, ValueError, TypeError) as error:
        raise ConfigError(path, "vehicles and trains", str(error).strip("'\""), "See docs/passages.md") from None


def read_clusters(path: Path) -> Clusters | None:
    """The current clusters, None where none were fitted."""
    return Clusters.of(json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else None


def read_loads(path: Path) -> dict[str, dict[str, LoadCalibration]]:
    """Turnout -> channel -> calibration; empty where none was made."""
    if not path.is_file():
        return {}
    document = json.loads(path.read_text(encoding="utf-8"))
    return {
        turnout: {
            name: LoadCalibration(**{**values, "covariance": np.array(values["covariance"])})
            for name, values in channels.items()
        }
        for turnout, channels in document.items()
    }


def _digest(path) -> str:
    return sha256_of(path) if Path(path).is_file() else ""
