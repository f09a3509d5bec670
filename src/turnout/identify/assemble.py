"""Put modes, their residues and what is told about them together into a modal model."""

import numpy as np

from turnout.identify.held_out import held_out_fit, random_mode_fits
from turnout.identify.poles import discrete_pole
from turnout.identify.realise import block_model
from turnout.records import ModalModel, Rejection


def assemble(
    estimates, modes, residues, scored, rate: float, settings, *, method, status, diagnostics, scale, **rest
) -> ModalModel:
    """Modal model of one section.

    Parameters
    ----------
    estimates : list of ImpactEstimates
        One for each mode.
    modes : tuple of Mode
        Their campaign values, in the order of the state vector.
    residues : (n_mode,) array of complex
        Of the response that ``b`` stands for, which ``scale`` names.
    scored : (theta, records)
        Modes (n_impact, n_mode, 2) and decays (n_impact, n) that the held-out fit is over.
    rate : float
        [Hz]
    settings : IdentifySettings
    rest
        ``rejections``, ``rejected_modes``, ``stabilisation`` of the model.
    """
    a, b, c = block_model([discrete_pole(m.frequency, m.damping, rate) for m in modes], residues)
    theta, records = scored
    fits = held_out_fit(theta, records, rate)
    edges = {name: (low, high) for name, low, high in settings.bands()}
    bands = [edges[mode.band] for mode in modes]
    null = random_mode_fits(records, rate, bands, settings.null_draws) if len(records) else None
    told = {
        "fit_per_impact": tuple(float(f) for f in fits),
        "fit_null": None if null is None else float(np.quantile(null, 0.95)),
        "fit_null_draws": settings.null_draws,
        "scale": scale,
    }
    return ModalModel(
        a=a,
        b=b,
        c=c,
        rate=rate,
        modes=modes,
        method=method,
        status=status,
        per_impact=tuple(row for e in estimates for row in e.rows()),
        fit=float(np.median(fits)) if len(fits) and np.all(np.isfinite(fits)) else None,
        diagnostics=diagnostics | told,
        **rest,
    )


def no_model(rate, method, rejections, diagnostics, **extras) -> ModalModel:
    """A rejected model, with its reasons."""
    nothing = np.empty(0)
    return ModalModel(
        np.empty((0, 0)), nothing, nothing, rate, (), method, "rejected", rejections, diagnostics=diagnostics, **extras
    )


def no_decays(rate, method, dropped) -> ModalModel:
    """A rejected model, for there is no decay that can be used; ``dropped`` are (impact, Rejection)."""
    found = Rejection("not_identified", 0, 1, "no decay is long enough" if dropped else "no decays")
    return no_model(rate, method, (found, *(r for _, r in dropped)), {"dropped_impacts": tuple(dropped)})
