"""Models, axle patterns, clusters and load calibrations for the passages of one turnout."""

from __future__ import annotations

import json
from bisect import bisect_right
from collections.abc import Callable, Mapping
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError

from turnout.config.document import as_config_errors
from turnout.config.merge import digest
from turnout.config.settings.passage import PassageSettings
from turnout.content import sha256_of
from turnout.errors import ConfigError
from turnout.passage.axle_load import LoadCalibration
from turnout.passage.axle_patterns import Pattern, read_patterns
from turnout.passage.clusters import Clusters
from turnout.records import ModalModel, Unit
from turnout.stages.passage import PassageContext, SectionModel
from turnout.workflow.current_results import current_results
from turnout.workflow.notes import MAX_FILE_DURATION, start_of


def passage_context(
    turnout: str, settings: Mapping[str, Any] | None = None, work: str | Path = "work"
) -> tuple[Callable[[Unit], str], PassageContext]:
    """Everything that the passages of one turnout are analysed with, and a token that changes with it.

    Models are read from the results of the hammer stage in ``work``. A passage is fitted with the latest model before
    it, so a new campaign changes the scores of later passages only.

    Parameters
    ----------
    turnout : str
        Id of the turnout.
    settings : mapping of str to any or None
        Settings by section of the configuration; None: the defaults.
    work : str or Path
        Folder of the nightly run's results.

    Returns
    -------
    tuple of (callable, PassageContext)
        ``token(unit)`` and the context. The token changes with the models that may be fitted to the passage, the
        patterns, clusters and calibrations.

    Raises
    ------
    ConfigError
        The file of the axle patterns cannot be used.
    """
    passage_settings = settings["passage"] if settings else PassageSettings()
    models, clusters_file = section_models(turnout, work), Path(passage_settings.assets) / "clusters.json"
    clusters, loads = (
        read_clusters(clusters_file),
        read_loads(Path(passage_settings.assets) / "loads.json").get(turnout, {}),
    )
    digests = [_digest(passage_settings.axle_patterns), _digest(clusters_file), repr(sorted(loads.items()))]

    def token(unit: Unit) -> str:
        used = [[m.model_id for m in applicable_models(section, unit.label)] for _, section in sorted(models.items())]
        return digest([digests, used])[:16]

    return token, PassageContext(models, known_patterns(passage_settings.axle_patterns), clusters, loads)


def applicable_models(models: tuple[SectionModel, ...], label: str) -> tuple[SectionModel, ...]:
    """Models that may be fitted to the passages of a file, by the time in its name.

    Parameters
    ----------
    models : tuple of SectionModel
        Models of one section, in order of time.
    label : str
        Label of the file's unit.

    Returns
    -------
    tuple of SectionModel
        All models if the name has no time.
    """
    start = start_of(label)
    if start is None:
        return models
    now, end = (bisect_right(models, time, key=lambda m: m.measured_at) for time in (start, start + MAX_FILE_DURATION))
    return (*(models[now - 1 : now] if now else models[:1]), *models[now:end])


def section_models(turnout: str, work: str | Path = "work") -> dict[str, tuple[SectionModel, ...]]:
    """Accepted models of each section, by label, in order of time.

    Parameters
    ----------
    turnout : str
        Id of the turnout.
    work : str or Path
        Folder of the nightly run's results.

    Returns
    -------
    dict of str to tuple of SectionModel
        Models by label of the section.
    """
    by_section: dict[str, list[SectionModel]] = {}
    for result in current_results(work, "hammer", turnout):
        for row in result.tables.get("models", []):
            if row["status"] in ("accepted", "second_order_only") and row["model_order"]:
                label = row["section_id"].removeprefix(f"{turnout}/")
                by_section.setdefault(label, []).append(_section_model(row))
    return {label: tuple(sorted(ms, key=lambda m: (m.measured_at, m.model_id))) for label, ms in by_section.items()}


def _section_model(row: Mapping[str, Any]) -> SectionModel:
    n = int(row["model_order"])
    a = np.asarray(row["a_matrix"], float).reshape(n, n)
    b, c = np.asarray(row["b_vector"], float), np.asarray(row["c_vector"], float)
    model = ModalModel(a, b, c, float(row["sampling_rate_hz"]), (), row["method"], row["status"])
    moment = row["measured_at_utc"]
    moment = moment if isinstance(moment, datetime) else datetime.fromisoformat(str(moment))
    return SectionModel(row["model_id"], moment, model)


def known_patterns(path: str) -> tuple[Pattern, ...]:
    """Axle patterns of known trains.

    Parameters
    ----------
    path : str
        YAML file.

    Returns
    -------
    tuple of Pattern
        Empty if the default file does not exist.

    Raises
    ------
    ConfigError
        The file cannot be used, or is not the default one and does not exist.
    """
    if Path(path).is_file():
        return _read_patterns(path, sha256_of(path))
    if path != PassageSettings().axle_patterns:
        raise ConfigError(path, "passage.axle_patterns", "there is no such file", "Name one, or leave the setting out")
    return ()


@lru_cache(maxsize=4)
def _read_patterns(path: str, content: str) -> tuple[Pattern, ...]:
    """Axle patterns of a file; ``content`` is its hash, since the same name may be another file."""
    try:
        with as_config_errors(path, "the file"):
            return read_patterns(YAML(typ="safe").load(Path(path)))
    except (KeyError, ValueError, TypeError, AttributeError, MarkedYAMLError) as error:
        message = " ".join(str(error).split())
        message = message.strip("'\"") if isinstance(error, KeyError) else message
        if isinstance(error, KeyError) and len(message.split()) == 1:
            message = f"{message!r} is missing"
        elif isinstance(error, (TypeError, AttributeError)):
            message = "they are not two tables of names with values"
        raise ConfigError(
            path, "vehicles and trains", message, "Compare it with the file of a new project (turnout init)"
        ) from None


def read_clusters(path: Path) -> Clusters | None:
    """The current clusters, None if none were fitted.

    Parameters
    ----------
    path : Path
        JSON file, which may be missing.

    Returns
    -------
    Clusters or None
        None without a file.
    """
    return Clusters.of(json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else None


def _types_of(values: Mapping[str, Any]) -> tuple[str, ...] | None:
    """Train types of a calibration in a file, None in the file of an earlier version."""
    types = values.get("types")
    return None if types is None else tuple(types)


def read_loads(path: Path) -> dict[str, dict[str, LoadCalibration]]:
    """Axle load calibrations of all turnouts.

    Parameters
    ----------
    path : Path
        JSON file, which may be missing.

    Returns
    -------
    dict of str to dict of str to LoadCalibration
        Calibrations by turnout and channel; empty without a file.
    """
    if not path.is_file():
        return {}
    document = json.loads(path.read_text(encoding="utf-8"))
    return {
        turnout: {
            name: LoadCalibration(
                **{**values, "covariance": np.array(values["covariance"]), "types": _types_of(values)}
            )
            for name, values in channels.items()
        }
        for turnout, channels in document.items()
    }


def _digest(path: str | Path) -> str:
    return sha256_of(path) if Path(path).is_file() else ""
