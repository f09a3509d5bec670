"""Independent, slow computation of what the views of the registry give: plain loops, pandas and statsmodels."""

import numpy as np
import pandas as pd
import statsmodels.api as sm

KEYS = ["turnout_id", "section_id", "band", "source"]


def cusum_by_loop(charts, baselines) -> pd.Series:
    """CUSUM for a loss of stiffness at every campaign, computed in a loop as in Page's definition.

    An outlier waits in ``held`` until the next campaign judged is one on the same side; then both count.
    """
    joined = charts.merge(baselines[[*KEYS, "epoch", "allowance", "threshold_down"]], on=[*KEYS, "epoch"])
    sums = {}
    for chart, cells in joined.sort_values("measured_at_utc").groupby([*KEYS, "epoch"]):
        total, highest, held, side_before = 0.0, 0.0, 0.0, 0
        for cell in cells.itertuples(index=False):
            if cell.state in ("ok", "alarm_down", "alarm_up") and np.isfinite(cell.z):
                limit = min(0.6 * cell.threshold_down + cell.allowance, 3.0)
                side = 0 if abs(cell.z) <= limit else int(np.sign(cell.z))
                fall = 0.6 * cell.threshold_down if side < 0 else -cell.z - cell.allowance
                if side and side != side_before:
                    held = fall
                else:
                    total, held = max(0.0, total + fall + (held if side else 0.0)), 0.0
                side_before = side
                if total <= highest - cell.threshold_down:  # the chart has returned
                    total = 0.0
                highest = max(highest, total) if total else 0.0
            sums[(*chart[:4], cell.measured_at_utc)] = total
    index = pd.MultiIndex.from_tuples(sums, names=[*KEYS, "measured_at_utc"])
    return pd.Series(list(sums.values()), index)


def residuals_by_pandas(modes, charts, baselines) -> pd.Series:
    """Frequency minus level, temperature effect and the median of the other complete sections, campaign by campaign.

    Level, slope and siblings are estimated again from ``modes``. Of ``baselines`` only the flags of siblings and
    completeness are used, of ``charts`` the states of the campaigns.
    """
    cells = charts[charts["section_id"] != "*"].merge(modes, on=[*KEYS, "measured_at_utc"], suffixes=("", "_mode"))
    cells = cells.merge(baselines[[*KEYS, "epoch", "with_siblings", "complete"]], on=[*KEYS, "epoch"])
    centred = []
    for _, chart in cells.groupby(KEYS):
        base = chart["state"] == "baseline"
        f0 = chart.loc[base, "frequency_hz"].mean()
        percent = 100.0 * (chart["frequency_hz"] / f0 - 1.0)
        design = sm.add_constant(chart["rail_temperature_c_mode"] - chart.loc[base, "rail_temperature_c_mode"].mean())
        scatter = np.sqrt(sm.OLS(percent[base], design[base]).fit().scale)
        # prior of the slope, 0 ± 0.5 %/°C, as one more observation
        design_with_prior = np.vstack([design[base], [0.0, scatter / 0.5]])
        residual = percent - design @ sm.OLS(np.append(percent[base], 0.0), design_with_prior).fit().params
        centred.append(chart.assign(centred=residual))
    cells = pd.concat(centred)
    median = []
    for _, campaign in cells.groupby(["turnout_id", "band", "source", "measured_at_utc"]):
        settled = campaign["complete"] & (campaign["state"] != "learning") & campaign["is_sibling"]
        for i in range(len(campaign)):
            siblings = np.delete(campaign["centred"].to_numpy(), i)[np.delete(settled.to_numpy(), i)]
            use = campaign["with_siblings"].iloc[i] and len(siblings) >= 3
            median.append((campaign.index[i], np.median(siblings) if use else np.nan))
    cells = cells.reset_index(drop=True) if cells.index.has_duplicates else cells
    cells["median"] = pd.Series(dict(median))
    against = cells["centred"] - cells["median"]
    shift = against[cells["state"] == "baseline"].groupby([cells[k] for k in KEYS]).mean()
    beside = against - pd.Series(shift.reindex(pd.MultiIndex.from_frame(cells[KEYS])).to_numpy(), cells.index)
    return beside.fillna(cells["centred"]).set_axis(pd.MultiIndex.from_frame(cells[[*KEYS, "measured_at_utc"]]))


def slopes_by_statsmodels(modes, days) -> pd.Series:
    """Slope [%/a] of each chart on time and temperature together over the last days."""
    newest = modes["measured_at_utc"].max()
    recent = modes[modes["measured_at_utc"] > newest - pd.Timedelta(days=days)]
    slopes = {}
    for chart, rows in recent.groupby(KEYS, observed=True):
        years = (rows["measured_at_utc"] - newest) / pd.Timedelta(days=365.25)
        columns = np.column_stack([np.ones(len(rows)), years, rows["rail_temperature_c"]])
        fit = sm.OLS(rows["frequency_hz"].to_numpy(), columns).fit()
        slopes[chart] = 100.0 * fit.params[1] / rows["frequency_hz"].mean()
    return pd.Series(list(slopes.values()), pd.MultiIndex.from_tuples(slopes, names=KEYS))
