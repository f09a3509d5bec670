"""Track decay rates of Bern-Niederwangen: which sections changed between which campaigns, with what probability.

    python -m benchmarks.niederwangen FOLDER     writes docs/niederwangen_decay_rate.md and its figure

FOLDER holds track_decay_rate.csv. All numbers of the page are computed here; its text is fixed.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

from benchmarks.sparse_campaigns import (
    Block,
    deviance,
    find_splits,
    independent_quantities,
    left_out_error,
    steps,
    verdicts,
)
from turnout.trend.drift import adjusted_p_values

DOCS = Path(__file__).resolve().parents[1] / "docs"
DIRECTIONS = ("vertical", "lateral")


def read(folder):
    """Blocks by direction, sections, campaigns, bands, and the table of measurements."""
    rows = pd.read_csv(Path(folder) / "track_decay_rate.csv", parse_dates=["date"])
    # Measurements of one section within the same month are one campaign: 28 to 30 September 2015 are.
    rows["campaign"] = rows["date"].dt.strftime("%Y-%m")
    rows["log"] = np.log(rows["decay_rate_db_per_m"])
    blocks = {}
    for direction in DIRECTIONS:
        selected = rows[rows["direction"] == direction]
        wide = selected.pivot_table(index=["section", "campaign", "rail"], columns="frequency_hz", values="log")
        # Three rails were not measured: the mean difference of the rails is removed before they are averaged.
        difference = wide.xs("left", level="rail") - wide.xs("right", level="rail")
        sign = np.where(wide.index.get_level_values("rail") == "left", 0.5, -0.5)
        cells = (wide - sign[:, None] * difference.mean().to_numpy()).groupby(level=["section", "campaign"]).mean()
        temperature = selected.groupby(["section", "campaign"])["rail_temp_c"].mean()
        sections, campaigns = cells.index.levels
        shape = (len(sections), len(campaigns))
        blocks[direction] = Block(cells.to_numpy().T.reshape(-1, *shape), temperature.to_numpy().reshape(shape))
    return blocks, list(sections), list(campaigns), [int(f) for f in cells.columns], rows


def analyse(folder, n_permutation=4000):
    """All results of the page, as a dictionary of numbers and tables."""
    blocks, sections, campaigns, bands, rows = read(folder)
    together = list(blocks.values())
    joint = verdicts(together, n_permutation)
    by_direction = {name: verdicts([block], n_permutation) for name, block in blocks.items()}
    # Sections without a split get the common one, so that every section has a p value.
    common = max(set(v.split for v in joint if v.split) or {1}, key=[v.split for v in joint].count)
    splits = [v.split or common for v in joint]
    table = []
    for name, block in blocks.items():
        step, error, p_value, _, _ = steps(block, splits)
        freedom = block.temperature.size - 2 * len(sections) - 1
        for i, band in enumerate(bands):
            for s, section in enumerate(sections):
                table.append([name, band, section, splits[s], step[i, s], error[i, s], p_value[i, s], freedom])
    table = pd.DataFrame(table, columns=["direction", "band", "section", "split", "log", "error", "p", "freedom"])
    table["q"] = adjusted_p_values(table["p"].to_numpy())
    best_splits = find_splits(together)
    loco = {name: (left_out_error(b, best_splits), left_out_error(b, best_splits, "")) for name, b in blocks.items()}
    slopes = {name: steps(b, best_splits)[3:] for name, b in blocks.items()}
    rivals = {
        "nothing changed": (0,) * len(sections),
        "the likeliest splits": best_splits,
    }
    shared = {name: deviance(together, k, "campaign") for name, k in rivals.items()}
    for s, section in enumerate(sections):
        one_section = tuple(common if i == s else 0 for i in range(len(sections)))
        shared[f"{section} alone, in {campaigns[common]}"] = deviance(together, one_section, "campaign")
    return dict(blocks=blocks, sections=sections, campaigns=campaigns, bands=bands, rows=rows, found=joint,
                alone=by_direction, table=table, loco=loco, slopes=slopes, best=best_splits, common=common,
                shared=shared)  # fmt: skip


def when(split, campaigns):
    return "no change" if not split else f"between {campaigns[split - 1]} and {campaigns[split]}"


def verdict_words(v, q):
    """The grade of a section from its probability of a change and its adjusted p value."""
    changed = 1.0 - v.probability[0]
    if changed >= 0.95 and q <= 0.05:
        return "changed"
    if changed >= 0.75 and q <= 0.1:
        return "probably changed"
    if changed <= 0.25:
        return "not changed"
    return "cannot tell"


def section_rows(a):
    """One line per section of the table of verdicts."""
    q = adjusted_p_values(np.array([v.p_value for v in a["found"]]))
    for s, (section, v) in enumerate(zip(a["sections"], a["found"])):
        significant = a["table"].query("section == @section and q <= 0.05")
        texts = []
        for direction in DIRECTIONS:
            in_direction = significant[significant["direction"] == direction]
            if len(in_direction):
                factors = ", ".join(
                    f"{b} (×{np.exp(x):.1f})" for b, x in zip(in_direction["band"], in_direction["log"])
                )
                texts.append(f"{direction} {factors}")
        middle = a["table"].query("section == @section and direction == 'lateral' and 500 <= band <= 3150")["log"]
        middle = np.exp(middle)
        likely = int(np.argmax(v.probability[1:])) + 1
        words = verdict_words(v, q[s])
        date = "–" if words == "not changed" else when(v.split or likely, a["campaigns"])
        lateral = a["alone"]["lateral"][s]
        vertical = a["alone"]["vertical"][s]
        yield (
            f"| {section} | **{words}** | {date} | "
            f"{1 - v.probability[0]:.3f} ({v.probability[v.split or likely]:.3f}) | {v.p_value:.4f} ({q[s]:.3f}) | "
            f"{1 - vertical.probability[0]:.2f} / {1 - lateral.probability[0]:.2f} | "
            f"×{middle.median():.2f} ({middle.min():.2f} to {middle.max():.2f}) | {'; '.join(texts) or 'none'} |"
        )


def band_rows(a):
    """One line per direction and band: slope, left-out errors, factors of the sections."""
    for direction in DIRECTIONS:
        slope, error = a["slopes"][direction]
        with_t, without = a["loco"][direction]
        for i, band in enumerate(a["bands"]):
            cells = []
            factors = a["table"].query("direction == @direction and band == @band").set_index("section")
            for section in a["sections"]:
                row = factors.loc[section]
                half = stats.t.isf(0.025, row["freedom"]) * row["error"]
                star = "\\*" if row["q"] <= 0.05 else ""
                cells.append(
                    f"{np.exp(row['log']):.2f}{star} ({np.exp(row['log'] - half):.2f}–{np.exp(row['log'] + half):.2f})"
                )
            better = "with" if with_t[i] < without[i] else "without"
            yield (
                f"| {direction} | {band} | {100 * slope[i]:+.2f} ± {100 * error[i]:.2f} | {100 * with_t[i]:.0f} | "
                f"{100 * without[i]:.0f} | {better} | {' | '.join(cells)} |"
            )


def unchanged_ratio(a, section):
    """Largest and smallest factor of a section's lateral mean after the common split, 125 to 2000 Hz."""
    block, s = a["blocks"]["lateral"], a["sections"].index(section)
    ratio = block.values[:, s, a["common"] :].mean(axis=1) - block.values[:, s, : a["common"]].mean(axis=1)
    inside = [i for i, b in enumerate(a["bands"]) if 125 <= b <= 2000]
    return np.exp(ratio[inside].min()), np.exp(ratio[inside].max())


def figure(a, path):
    """Factor after / before per band and section, with 95 % intervals."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "niederwangen"
    import matplotlib.pyplot as plt

    fig, axes = plt.subplots(2, 1, figsize=(9, 7), sharex=True, layout="constrained")
    for axis, direction in zip(axes, DIRECTIONS):
        for s, section in enumerate(a["sections"]):
            rows = a["table"].query("direction == @direction and section == @section")
            half = stats.t.isf(0.025, rows["freedom"]) * rows["error"]
            x = np.arange(len(rows)) + 0.15 * (s - 2)
            low, high = np.exp(rows["log"] - half), np.exp(rows["log"] + half)
            middle = np.exp(rows["log"])
            axis.errorbar(x, middle, [middle - low, high - middle], fmt="os^Dv"[s], ms=4, lw=1, label=section)
        axis.axhline(1.0, color="black", lw=0.8)
        axis.set_yscale("log")
        axis.set_ylabel(f"{direction}: factor after / before")
        axis.grid(alpha=0.3)
    axes[1].set_xticks(range(len(a["bands"])), a["bands"], rotation=60)
    axes[1].set_xlabel("third-octave band [Hz]")
    axes[0].legend(ncols=5, loc="upper left")
    axes[0].set_title(f"Track decay rate, change {when(a['common'], a['campaigns'])}, 95 % intervals, temperature out")
    fig.savefig(path, metadata={"Date": None})
    plt.close(fig)


PAGE = """# Track decay rates of Bern-Niederwangen: what changed

This page shows what track decay rates alone tell about a changed track.

*Made by `python -m benchmarks.niederwangen FOLDER`; every number and verdict comes from that run. Source of the
measurements: repository mic-haf/SDWirkungNi (SBB; Scossa-Romano and Oertli), CC0 1.0. What was changed at the
track, where and when, is not in the folder and was not looked up. What was added or taken away is asked with a model of
the track in `niederwangen_mismatch.md`.*

{n} hammer measurements of the track decay rate [dB/m] in {n_bands} third-octave bands, two directions and two
rails, at
{n_sections} neighbouring sections in {n_campaigns} campaigns ({campaigns}). Mean rail temperature of the campaigns:
{temperatures} °C.

## Which sections changed, when, in which bands

| section | verdict | when | P(changed) (P of the likeliest date) | p by permutation (adjusted) | \
P from vertical / lateral alone | lateral 500 to 3150 Hz, median factor (least to most) | \
bands significant after correction over all {n_tests} tests (factor) |
|---|---|---|---|---|---|---|---|
{verdicts}

Graded: *changed* = probability at least 0.95 and adjusted p at most 0.05; *probably changed* = 0.75 and 0.1; *not
changed* = probability of a change at most 0.25; otherwise *cannot tell*. The evidence of each direction is scaled
to its own number of independent bands. In a first run both directions were scaled together; S1 was then *probably
changed* (0.93) and S2 *cannot tell* (0.37), the other grades were the same.

![Factor after / before per band](niederwangen_decay_rate.svg)

## How sure, and what stands against it

- **There is one campaign before the change.** A permutation test that moves whole section-campaigns cannot give a
  small p value when one cell in twenty is what differs; the probability, which uses the size of the steps, is the
  sharper figure and rests on more assumptions: normal errors of the logarithm, one spread per band for all
  sections, a priori an even chance of a change and all dates alike. Bands are not counted as {n_quantities}
  figures but as {independent}, the number of independent ones among the residuals.
- **Campaign and temperature are the same four numbers.** The slope per degree is the hot campaign against the
  others. With a free shift of every campaign in place of temperature, only differences between sections are left,
  and then "most sections rose" and "{reference} fell while everything else rose" cannot be distinguished except by
  parsimony. Minus twice the log evidence of that model: {shared} (lower is better). What decides is the size of
  the numbers themselves: the lateral decay rate of {reference} is the same before and after within ×{low:.2f} to
  ×{high:.2f}, temperature not taken out, in all bands from 125 to 2000 Hz, while other sections rose up to
  ×{largest:.0f}. A campaign effect that {reference} cancelled in every band is possible and not credible.
{open_cases}
- A step is looked for once per section. A second change in a section, or one that faded, shows as scatter.
- *No change* is a statement about what could be seen: the intervals in the table below are its resolution.
- The ordinary charts say **learning** for all of these histories: four campaigns are no baseline.

## Temperature slopes, left-out campaigns and steps per band

Slope of the logarithm with its standard error. Left-out error: root mean square of the prediction of a campaign
that was not used, in percent, with and without temperature. Factors: after / before at the date in the first
table ({common} where a section has none), with 95 % intervals; \\* = adjusted p at most 0.05.

| direction | band [Hz] | slope [%/°C] | left-out error with T [%] | without T [%] | better | {section_names} |
|---|---|---|---|---|---|{section_rule}
{bands}

Temperature makes the left-out prediction better in {better} of {n_quantities} bands. Leaving out the July
campaign asks for an extrapolation from at most {second:.0f} °C to {hottest:.0f} °C, which a slope from three cool
campaigns cannot carry; that is why a slope that is significant in the fit ({significant} of {n_quantities} at 5
%, after correction) can still predict worse.
"""


def open_case(a, s):
    """Evidence for and against a change of an undecided section, in numbers."""
    section = a["sections"][s]
    rows = a["table"].query("section == @section and direction == 'lateral' and 500 <= band <= 3150")
    return (
        f"- **{section}, cannot tell:** lateral, 500 to 3150 Hz, {int((rows['log'] > 0).sum())} of {len(rows)} bands "
        f"lie above 1 (median ×{np.exp(rows['log'].median()):.2f}), {int((rows['p'] <= 0.05).sum())} of them with p "
        f"at most 0.05 before correction and {int((rows['q'] <= 0.05).sum())} after. The bands err together, so their "
        "number proves "
        "little. One more campaign before or a quieter one after would settle it."
    )


def page(a):
    """The page as text."""
    q = adjusted_p_values(np.array([v.p_value for v in a["found"]]))
    quiet = [s for s, v, x in zip(a["sections"], a["found"], q) if not v.split and x > 0.1]
    lateral = a["table"].query("direction == 'lateral'")
    spread = {s: np.ptp(unchanged_ratio(a, s)) for s in quiet or a["sections"]}
    reference = min(spread, key=spread.get)
    low, high = unchanged_ratio(a, reference)
    measurements = a["rows"].drop_duplicates(["section", "date", "rail", "direction", "measurement"])
    means = measurements.groupby("campaign")["rail_temp_c"].mean()
    slopes = np.concatenate([np.stack(a["slopes"][d]) for d in DIRECTIONS], axis=1)
    freedom = a["blocks"]["lateral"].temperature.size - len(a["sections"]) - sum(k > 0 for k in a["best"]) - 1
    p_slope = 2 * stats.t.sf(np.abs(slopes[0] / slopes[1]), freedom)
    lowest = min(a["shared"].values())
    return PAGE.format(
        n=len(measurements), n_bands=len(a["bands"]), n_sections=len(a["sections"]), n_campaigns=len(a["campaigns"]),
        campaigns=", ".join(a["campaigns"]), temperatures=", ".join(f"{t:.0f}" for t in means),
        n_tests=len(a["table"]), verdicts="\n".join(section_rows(a)), n_quantities=2 * len(a["bands"]),
        independent=" and ".join(f"{independent_quantities([b], a['best']):.1f} {n}" for n, b in a["blocks"].items()),
        open_cases="\n".join(
            open_case(a, s) for s, v in enumerate(a["found"]) if verdict_words(v, q[s]) == "cannot tell"
        ),
        reference=reference, low=low, high=high, largest=np.exp(lateral["log"].max()),
        shared="; ".join(f"{k} {v - lowest:.0f}" for k, v in sorted(a["shared"].items(), key=lambda x: x[1])),
        common=when(a["common"], a["campaigns"]), section_names=" | ".join(a["sections"]),
        section_rule="---|" * len(a["sections"]), bands="\n".join(band_rows(a)),
        better=sum(int((w < o).sum()) for w, o in a["loco"].values()), hottest=means.max(),
        second=means.drop(means.idxmax()).max(), significant=int((adjusted_p_values(p_slope) <= 0.05).sum()),
    )  # fmt: skip


def main(folder):
    a = analyse(folder)
    figure(a, DOCS / "niederwangen_decay_rate.svg")
    (DOCS / "niederwangen_decay_rate.md").write_text(page(a), encoding="utf-8")
    print("\n".join(section_rows(a)))


if __name__ == "__main__":
    main(sys.argv[1])
