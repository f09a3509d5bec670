"""Share of campaigns with the name on the other of two neighbouring modes that ``modes_off_track`` lists, with and
without their shape at two responses: ``python -m benchmarks.mode_shapes [SEED]``.

Each section has 24 campaigns of ten impacts. Its two modes in the ballast band cross in frequency, or vary together by
more than their distance over the seasons. Their damping is the same, and the ratio of their residues varies between
campaigns. The sensors are mounted anew for each campaign.
"""

from __future__ import annotations

import sys
from importlib.resources import files

import duckdb
import numpy as np
import pandas as pd
from scipy.stats import beta

from turnout.config.settings.identify import IdentifySettings
from turnout.modal import identify
from turnout.modal.block_errors import blocks_with_errors
from turnout.modal.mode_shape import two_point_shapes
from turnout.modal.poles import continuous_pole

RATE, N, N_IMPACT, N_CAMPAIGN, N_SECTION = 10e3, 1000, 10, 24, 24
NOISE = 0.02  # of the amplitude of the first mode (34 dB)
SEASON = 1.0 + 0.05 * np.sin(2.0 * np.pi * np.arange(N_CAMPAIGN) / 12.0)
FREQUENCIES = {  # Hz: own mode, other mode and railpad mode of each campaign
    "crossing": np.linspace([150.0, 162.0, 480.0], [165.0, 155.0, 480.0], N_CAMPAIGN),
    "season": SEASON[:, None] * np.array([150.0, 162.0, 480.0]),
}
MIN_SEPARATION = 3.0  # Hz: below it the truth of a name is not decided by the frequency
MOUNTING_SD = 0.05  # of the ratio of both responses between campaigns, common to the modes, and complex
OPPOSITE, SMALLER = -0.7 + 0.2j, 0.35 + 0.1j  # ratio of the other mode; that of the own one is 0.8 + 0.1j
CASES = (  # frequencies, ratio of the other mode, damping, residue of the other mode over that of the own one
    ("season", 0.0, 0.03, 0.0),  # a single mode
    ("season", OPPOSITE, 0.01, 0.75),
    ("season", OPPOSITE, 0.03, 0.75),
    ("season", SMALLER, 0.01, 0.75),
    ("crossing", OPPOSITE, 0.01, 0.75),
    ("crossing", OPPOSITE, 0.03, 0.75),
)


def campaign(rng, frequency: np.ndarray, ratio: complex, damping: float, residue: float) -> list[dict]:
    """Rows of the ballast mode of one campaign; ``residue`` of the other mode over that of the section's own."""
    pole_spread = np.exp(0.003 * rng.standard_normal((N_IMPACT, 3)))
    theta = frequency * pole_spread
    wave = np.exp(continuous_pole(theta, np.array([damping, damping, 0.06]))[..., None] * np.arange(N) / RATE)
    size = 1.0 + 0.2 * rng.random((N_IMPACT, 1))
    one = np.array([1.0, residue * np.exp(0.3 * rng.standard_normal()), 1.0])
    one = one * np.exp(1j * rng.uniform(-0.3, 0.3, 3))
    gain = 1.0 + MOUNTING_SD * (rng.standard_normal() + 1j * rng.standard_normal()) / np.sqrt(2.0)
    two = one * gain * np.array([0.8 + 0.1j, ratio, 0.4])
    first, second = (
        list(size * (a[None, :, None] * wave).real.sum(axis=1) + NOISE * rng.standard_normal((N_IMPACT, N)))
        for a in (one, two)
    )
    model = identify(first, RATE, IdentifySettings(null_draws=10))
    shapes = two_point_shapes(model, first, second)
    rows = []
    for m, mode in enumerate(model.modes):
        if mode.band == "ballast":
            v = shapes[m].covariance
            rows.append({
                "frequency_hz": mode.frequency, "frequency_se_hz": mode.frequency_se, "damping_ratio": mode.damping,
                "damping_se": mode.damping_se, "c_block": list(blocks_with_errors(model)[m][0][4:]),
                "shape_ratio": [shapes[m].ratio.real, shapes[m].ratio.imag],
                "shape_covariance": [v[0, 0], v[0, 1], v[1, 1]], "n_shape": N_IMPACT,
                "is_other": bool(np.argmin(np.abs(mode.frequency - frequency[:2])) == 1),
                "is_decided": abs(frequency[0] - frequency[1]) >= MIN_SEPARATION,
                "n_in_band": sum(120.0 < f < 200.0 for f in model.diagnostics["modes_in_fit"]),
            })  # fmt: skip
    return rows


def fleet(seed: int, track: str, ratio: complex, damping: float, residue: float) -> pd.DataFrame:
    """Rows of all sections."""
    rows = []
    for s in range(N_SECTION):
        for k in range(N_CAMPAIGN):
            for row in campaign(np.random.default_rng([seed, s, k]), FREQUENCIES[track][k], ratio, damping, residue):
                at = pd.Timestamp("2024-01-01") + pd.Timedelta(days=30 * k)
                name = {"model_id": f"{s}-{k}", "section_id": str(s), "turnout_id": "t", "band": "ballast"}
                rows.append(row | name | {"measured_at_utc": at, "method": "joint", "source": "hammer", "k": k})
    return pd.DataFrame(rows)


def listed(modes: pd.DataFrame) -> pd.DataFrame:
    """The rows with at least five earlier campaigns, whether the view lists them without and with the shape."""
    view = files("turnout.registry").joinpath("views", "modes_off_track.sql").read_text(encoding="utf-8")
    with duckdb.connect() as connection:
        connection.register("modes_current", modes)
        connection.execute(view.replace("create or replace view", "create or replace temp view"))
        off = connection.execute("select * from modes_off_track").df().set_index("model_id")
    judged = modes[modes.groupby("section_id").cumcount() >= 5].set_index("model_id")
    before = (off.frequency_distance > 5.0) | (off.damping_distance > 5.0)
    return judged.assign(before=judged.index.isin(off.index[before]), after=judged.index.isin(off.index))


def share(values: pd.Series) -> str:
    """Share with its exact 95 % interval."""
    x, n = int(values.sum()), len(values)
    low = beta.ppf(0.025, x, n - x + 1) if x else 0.0
    high = beta.ppf(0.975, x + 1, n - x) if x < n else 1.0
    return f"{x} of {n} ({x / n if n else float('nan'):.3f}, {low:.3f} to {high:.3f})"


def report(name: str, rows: pd.DataFrame) -> None:
    """Print the shares of one fleet."""
    is_resolved = rows.n_in_band >= 2
    groups = {
        "other mode": rows[is_resolved & rows.is_decided & rows.is_other],
        "own mode": rows[is_resolved & rows.is_decided & ~rows.is_other],
        "one pole for both": rows[~is_resolved],
    }
    print(name)
    for label, group in groups.items():
        print(f"  {label}: listed before {share(group.before)}, after {share(group.after)}", flush=True)


def main(seed: int) -> None:
    """Print the shares of each case."""
    for case in CASES:
        report("{}, other mode: ratio {}, damping {}, residue {}".format(*case), listed(fleet(seed, *case)))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 38)
