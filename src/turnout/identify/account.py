"""What is told beside a model: stabilisation table, noise, drift, blows that were left out."""

import numpy as np

from turnout.identify.select import Selection


def stabilisation_rows(selection: Selection, tolerance: float) -> tuple[dict, ...]:
    """Poles of all orders from the first sample on; "stable" where they belong to a mode that was kept."""
    table = selection.table
    mean = selection.fit.mean if selection.fit is not None else np.empty((0, 2))
    rows = []
    for i in np.flatnonzero((table.start == 0) & (table.damping > 0.0)):
        near = np.abs(table.frequency[i] / np.exp(mean[:, 0]) - 1.0) < tolerance
        near &= np.abs(table.damping[i] - mean[:, 1]) < tolerance
        rows.append(
            {
                "order": int(table.order[i]),
                "frequency": float(table.frequency[i]),
                "damping": float(table.damping[i]),
                "emac": float(table.emac[i]),
                "status": "stable" if near.any() else "unstable",
            }
        )
    return tuple(rows)


def fit_diagnostics(selection: Selection, index, dropped) -> dict:
    """Numbers about the fit; ``index`` are the impacts in it, ``dropped`` (impact, Rejection) those that are not."""
    told = {"impacts": tuple(int(i) for i in index), "dropped_impacts": tuple(dropped)}
    fit = selection.fit
    if fit is None:
        return told
    absent = np.argwhere(~selection.shows)
    return told | {
        "noise": float(np.sqrt(fit.sigma2)),
        "noise_order": len(selection.whitening) - 1,
        "drift_degree": selection.background.drift_degree,
        "hum": selection.background.hum,
        "modes_in_fit": tuple(float(f) for f in np.exp(fit.mean[:, 0])),
        "damping_in_fit": tuple(float(zeta) for zeta in fit.mean[:, 1]),
        "converged": fit.converged,
        "explanations": 1 + len(selection.others),
        "impacts_without_mode": tuple((int(index[i]), float(np.exp(fit.mean[m, 0]))) for i, m in absent),
    }
