"""Group similar passages into clusters, found from the data and numbered so that a cluster keeps its id."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

if TYPE_CHECKING:
    from turnout.config.settings.passage import PassageSettings

MIN_MEMBER_SHARE = 1e-4  # of a cluster's members that are farther away; a passage below it is outside
MIN_SD = np.array([0.01, 0.02])  # least standard deviations of ln(speed) and ln(load)
MAX_SHIFT = 2.0  # standard deviations between the means of a cluster and the previous one whose id it keeps


@dataclass(frozen=True)
class Cluster:
    """``id`` "<type>/<number>", ``mean`` and ``covariance`` of (ln speed [km/h], ln axle load [t]), ``weight``.

    Where the loads of a type are not known, ``mean`` holds the logarithm of the speed alone.
    """

    id: str
    type: str
    mean: np.ndarray
    covariance: np.ndarray
    weight: float
    n: int


@dataclass(frozen=True)
class Clusters:
    """A fitted set of clusters. New passages are assigned to it; it changes only when it is fitted again.

    ``used`` maps a type to the highest number that a cluster of it ever had, also of traffic that has ended.
    """

    version: int
    clusters: tuple[Cluster, ...]
    used: Mapping[str, int] = field(default_factory=dict)

    def highest_number(self, train_type: str) -> int:
        """The highest number used for a type, 0 where it had none.

        Parameters
        ----------
        train_type : str
            Type of train.

        Returns
        -------
        int
            Also of clusters that have ended.
        """
        numbers = [_number(c.id) for c in self.clusters if c.type == train_type]
        return max([self.used.get(train_type, 0), *numbers])

    def assign(self, train_type: str | None, speed_kmh: float | None, axle_load_t: float | None) -> str | None:
        """Id of the cluster that a passage most likely belongs to; None where it lies outside all clusters of its type.

        Outside: only a share below ``MIN_MEMBER_SHARE`` of a cluster's members would be so far from it.

        Parameters
        ----------
        train_type : str or None
            Type of train; None gives None.
        speed_kmh : float or None
            Speed; None gives None. [km/h]
        axle_load_t : float or None
            Mean axle load; without it the speed alone is compared. [t]

        Returns
        -------
        str or None
            Id of the cluster.
        """
        if train_type is None or speed_kmh is None:
            return None
        highest_log, cluster_id = -np.inf, None
        for cluster in self.clusters:
            if cluster.type != train_type:
                continue
            point = np.log([speed_kmh] if axle_load_t is None else [speed_kmh, axle_load_t])
            n_dimension = min(len(point), len(cluster.mean))
            deviation = point[:n_dimension] - cluster.mean[:n_dimension]
            covariance = cluster.covariance[:n_dimension, :n_dimension]
            distance_squared = float(deviation @ np.linalg.solve(covariance, deviation))
            if scipy.stats.chi2.sf(distance_squared, n_dimension) < MIN_MEMBER_SHARE:
                continue
            log_density = np.log(cluster.weight) - 0.5 * distance_squared - 0.5 * np.linalg.slogdet(covariance)[1]
            if log_density > highest_log:
                highest_log, cluster_id = log_density, cluster.id
        return cluster_id

    def document(self) -> dict:
        """As plain values, for a JSON file.

        Returns
        -------
        dict
            Version, highest numbers and clusters; ``of`` reads it.
        """
        return {
            "version": self.version,
            "used": dict(self.used),
            "clusters": [
                {**vars(c), "mean": c.mean.tolist(), "covariance": c.covariance.tolist()} for c in self.clusters
            ],
        }

    @classmethod
    def of(cls, document: Mapping) -> Clusters:
        """From ``document()``.

        Parameters
        ----------
        document : mapping
            As ``document`` makes it.

        Returns
        -------
        Clusters
            The same clusters.
        """
        clusters = [
            Cluster(**{**c, "mean": np.array(c["mean"]), "covariance": np.array(c["covariance"])})
            for c in document["clusters"]
        ]
        return cls(int(document["version"]), tuple(clusters), dict(document.get("used", {})))


def fit_clusters(passages: Sequence[Mapping], settings: PassageSettings, previous: Clusters | None = None) -> Clusters:
    """Gaussian mixtures over (ln speed, ln load) for every train type, their number by BIC.

    Parameters
    ----------
    passages : sequence of mappings
        With train_type, speed_kmh, axle_load_t (may be None).
    settings : PassageSettings
        Largest number of clusters of a type, and the seed.
    previous : Clusters or None
        Clusters keep the ids of these whose means are within ``MAX_SHIFT``; the others get new numbers.

    Returns
    -------
    Clusters
        Version one above ``previous``.
    """
    clusters, previous = [], previous or Clusters(0, ())
    groups: dict[str, list] = {}
    for p in passages:
        if p["train_type"] and p["train_type"] != "unknown" and p["speed_kmh"]:
            groups.setdefault(p["train_type"], []).append((p["speed_kmh"], p["axle_load_t"]))
    for type_ in sorted(groups):
        rows = groups[type_]
        loaded = [r for r in rows if r[1] is not None]
        points = np.log([r for r in loaded]) if len(loaded) > 0.5 * len(rows) else np.log([[r[0]] for r in rows])
        previous_clusters = [c for c in previous.clusters if c.type == type_]
        next_number = previous.highest_number(type_) + 1
        clusters += _with_ids(type_, _mixture(points, settings), len(points), previous_clusters, next_number)
    fitted = Clusters(previous.version + 1, tuple(clusters), previous.used)
    types = sorted({c.type for c in (*previous.clusters, *clusters)} | set(previous.used))
    return replace(fitted, used={t: max(previous.highest_number(t), fitted.highest_number(t)) for t in types})


def _mixture(points: np.ndarray, settings: PassageSettings) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """(weight, mean, covariance) of the mixture with the lowest BIC, largest weight first."""
    from sklearn.mixture import GaussianMixture

    order = np.lexsort(points.T)
    points = points[order]  # the result must not depend on the order of the passages
    n_dimension = points.shape[1]
    min_sd = MIN_SD[:n_dimension]
    scaled = points / min_sd
    if len(points) == 1:  # one passage has no spread of its own
        return [(1.0, points[0], np.diag(min_sd**2))]
    chosen: Any = None
    lowest, n_worse = np.inf, 0
    for k in range(1, min(settings.cluster_maximum, max(len(points) // (5 * n_dimension), 1)) + 1):
        mixture = GaussianMixture(k, n_init=3, random_state=settings.cluster_seed, reg_covar=1.0).fit(scaled)
        bic = mixture.bic(scaled)
        if bic < lowest:
            chosen, lowest, n_worse = mixture, bic, 0
        else:
            n_worse += 1
            if n_worse == 3:
                break
    components = zip(chosen.weights_, chosen.means_ * min_sd, chosen.covariances_ * np.outer(min_sd, min_sd))
    return sorted(components, key=lambda p: (-p[0], tuple(p[1])))


def _with_ids(
    type_: str,
    components: Sequence[tuple[float, np.ndarray, np.ndarray]],
    n: int,
    previous_clusters: Sequence[Cluster],
    next_number: int,
) -> list[Cluster]:
    """Clusters with ids: those of the nearest previous clusters within ``MAX_SHIFT``.

    The sum of the distances is the least, of which each counts as ``MAX_SHIFT`` at most. The others get numbers from
    ``next_number`` on.
    """
    ids = {}
    if previous_clusters:
        distance = np.array([[_distance(m, s, c) for c in previous_clusters] for _, m, s in components])
        # a pair too far apart costs the same at any distance: it must not decide about the others
        for i, j in zip(*scipy.optimize.linear_sum_assignment(np.minimum(distance, MAX_SHIFT))):
            if distance[i, j] < MAX_SHIFT:
                ids[i] = previous_clusters[j].id
    clusters = []
    for i, (weight, mean, covariance) in enumerate(components):
        if i not in ids:
            ids[i] = f"{type_}/{next_number}"
            next_number += 1
        clusters.append(Cluster(ids[i], type_, mean, covariance, float(weight), round(weight * n)))
    return sorted(clusters, key=lambda c: _number(c.id))


def _distance(mean: np.ndarray, covariance: np.ndarray, previous: Cluster) -> float:
    """Distance of two means in standard deviations of the wider cluster: one of few passages has nearly no width.

    Only the speeds are compared where the loads are known in one of the clusters alone.
    """
    n = min(len(mean), len(previous.mean))
    shift = mean[:n] - previous.mean[:n]
    return min(float(np.sqrt(shift @ np.linalg.solve(c[:n, :n], shift))) for c in (covariance, previous.covariance))


def _number(id_: str) -> int:
    return int(id_.rsplit("/", 1)[1])
