"""Settings of the trend charts, their alarms and the worklist."""

from dataclasses import dataclass

from turnout.config.settings.setting import setting


@dataclass(frozen=True)
class TrendSettings:
    """How a resonance's history becomes a state, an alarm and a row of the worklist."""

    campaign_gap_hours: float = setting(
        36.0,
        "h",
        "values within this of a campaign's first belong to it: it may last into the night; work that resets ends it",
        minimum=0.0,
    )
    earliest_year: int = setting(1990, "", "an older time stamp comes from a clock that was never set", minimum=1900)
    clock_gap_days: float = setting(
        400.0, "d", "a single last campaign this long after all others counts as one with a wrong clock", minimum=1.0
    )
    baseline_days: float = setting(
        357.0, "d", "52 weekly campaigns: one whole year separates season from drift", minimum=1.0
    )
    baseline_campaigns: int = setting(
        12, "", "fewest campaigns with temperature in a baseline; the guard grows where they are few", minimum=6
    )
    siblings_minimum: int = setting(
        3, "", "other sections needed for the turnout's median: the fewest of which one may be wrong", minimum=2
    )
    siblings_share: float = setting(
        0.8, "", "share of the baseline with enough siblings, else the chart stands alone", minimum=0.0, maximum=1.0
    )
    target_percent: float = setting(
        1.5, "%", "change in frequency to be seen: 3 % of stiffness, one degree of freedom", minimum=0.01, maximum=20.0
    )
    target_damping_percent: float = setting(
        20.0, "%", "change of a damping ratio to be seen; no limit is published, so this is an estimate", minimum=0.01
    )
    target_acceleration_percent: float = setting(
        10.0,
        "%",
        "change of a peak acceleration to be seen: weekly values scatter by 3 to 8 %; no limit is published",
        minimum=0.01,
    )
    allowance_large: float = setting(
        1.0, "", "CUSUM allowance k where the target is at least allowance_switch standard deviations", minimum=0.1
    )
    allowance_small: float = setting(0.5, "", "CUSUM allowance k elsewhere", minimum=0.1)
    allowance_switch: float = setting(1.2, "", "target in standard deviations from which the large k serves better")
    guard_large: float = setting(
        1.12, "", "widening of sigma for the estimated baseline of 52 campaigns, k = 1", minimum=1.0
    )
    guard_small: float = setting(1.25, "", "the same for k = 0.5", minimum=1.0)
    learning_large: int = setting(12, "", "campaigns that learn the level after an event, k = 1", minimum=4)
    learning_small: int = setting(26, "", "the same for k = 0.5", minimum=4)
    run_length_loss: float = setting(
        5600.0,
        "",
        "mean campaigns between false alarms of one chart, loss of stiffness: 10 a week in 56,000 charts",
        minimum=20.0,
    )
    run_length_gain: float = setting(
        56000.0, "", "the same for a gain of stiffness, which is rarely urgent: a tenth of the alarms", minimum=20.0
    )
    run_length_damping: float = setting(
        112000.0,
        "",
        "the same for a damping ratio, up and down alike: both together a tenth of the alarms of its resonance",
        minimum=20.0,
    )
    single_share: float = setting(
        0.6,
        "",
        "largest share of the threshold that one campaign can bring; above 0.5 two confirmed outliers are an alarm",
        minimum=0.1,
        maximum=1.0,
    )
    outlier_limit: float = setting(
        3.0,
        "",
        "a campaign with |z| beyond this counts only if the next one confirms it: one bad campaign is no alarm",
        minimum=2.0,
    )
    confirm_sd: float = setting(
        6.0, "", "a campaign this many standard deviations from its expected value is to be confirmed now", minimum=3.0
    )
    confirm_percent: float = setting(
        10.0,
        "%",
        "a change of frequency to be confirmed now also where the chart scatters more, from three standard deviations",
        minimum=1.0,
    )
    detectable_probability: float = setting(
        0.9, "", "the detectable change is seen within a year with this probability", minimum=0.5, maximum=0.999
    )
    not_measured_days: float = setting(
        90.0, "d", "older than this and than three of its own intervals a chart is not measured", minimum=1.0
    )
    false_discovery: float = setting(
        0.1, "", "expected share of false names among the drifts reported", minimum=0.001, maximum=0.5
    )
    drift_days: float = setting(300.0, "d", "shortest span of a slope; below it season is not separable", minimum=30.0)
    limit_percent: float = setting(-5.0, "%", "change in frequency at which work is due", maximum=-0.01)
    interval_level: float = setting(
        0.8, "", "level of the interval of the time to the limit", minimum=0.5, maximum=0.99
    )
    horizon_years: float = setting(20.0, "a", "a limit reached later than this counts as no limit", minimum=1.0)
    worklist_rows: int = setting(
        20, "", "rows of the worklist, what a person can act on in a day; open alarms are listed beyond it", minimum=1
    )
