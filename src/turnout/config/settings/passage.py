"""Settings of the passage analysis: axles, speed, train type, joint fit of all wheels, scores, clusters."""

from __future__ import annotations

from dataclasses import dataclass

from turnout.config.settings.setting import setting


@dataclass(frozen=True)
class PassageSettings:
    """How a train passage is cut, counted, timed, fitted and scored."""

    # joint fit
    band_low: float = setting(80.0, "Hz", "below it hammer tests carry no information (paper, section on tests)", 1.0)
    band_high: float = setting(800.0, "Hz", "above it the plastic tip excites nothing (paper)", 10.0)
    filter_order: int = setting(4, "", "Butterworth order of each edge; the model passes the same filter", 1, 8)
    score_window: float = setting(
        0.05, "s", "scored after each wheel: twice the longest decay time of the paper's tables", 0.001, 1.0
    )
    forecast_train: float = setting(0.005, "s", "jump of a wheel estimated from this much data", 0.0005, 0.1)
    forecast_test: float = setting(0.015, "s", "and judged on this much that follows", 0.001, 0.5)
    time_search: float = setting(0.003, "s", "how far an impact may lie from the detected axle", 0.0, 0.02)
    delay_search: float = setting(
        0.015, "s", "how far all impacts together may lie from the detected axles at a sensor", 0.0, 0.1
    )
    ambiguity_odds: float = setting(
        100.0, "", "an impact time is flagged unless its interval beats every other one by these odds", 1.0
    )
    chi_squared_level: float = setting(0.01, "", "level of the per-wheel test of the jump's direction", 1e-6, 0.2)
    not_an_impulse_share: float = setting(
        0.5, "", "the load is not an impulse where more wheels than this share fail the test of the direction", 0.0, 1.0
    )
    along_b_minimum: float = setting(
        0.8,
        "",
        "and less than this share of the jumps' power is along b: 0.9 for a model 10 % off, 0.3 for a 3 ms pulse",
        0.0,
        1.0,
    )
    null_models: int = setting(
        30, "", "random models behind each null band; fewer than 19 have no 95 % quantile", 19, 1000
    )
    scored_share: float = setting(
        1.0, "", "share of the passages that are scored; of the others only the peak acceleration is kept", 0.0, 1.0
    )
    null_seed: int = setting(20171001, "", "seed of the random pole pairs: the same for every passage", 0)
    # axles, speed, direction
    envelope_step: float = setting(0.001, "s", "grid of the band envelope that axles are sought in", 1e-4, 0.01)
    speed_minimum: float = setting(15.0, "km/h", "slower trains are not sought", 1.0)
    speed_maximum: float = setting(250.0, "km/h", "faster trains are not sought", 10.0)
    axle_spacing_minimum: float = setting(
        1.3, "m", "no two axles are closer (freight bogies have 1.8 m, three-axle bogies 1.5 m)", 0.5, 3.0
    )
    axle_level: float = setting(
        3.0, "", "peaks below this many noise deviations are not considered as axles", 1.0, 50.0
    )
    place_error: float = setting(
        0.05, "m", "standard error of the position at which a sensor records a wheel", 0.0, 1.0
    )
    acceleration_limit: float = setting(1.2, "m/s²", "service braking and traction stay below it", 0.1, 5.0)
    # train type
    type_tolerance: float = setting(
        0.04, "m", "standard deviation of an axle against its template: build tolerance, wear, coupler slack", 0.005
    )
    type_probability: float = setting(0.95, "", "a type is named from this posterior probability on", 0.5, 1.0)
    unknown_prior: float = setting(0.2, "", "prior probability of a type that has no template", 0.001, 0.9)
    # loads
    load_relative_error_maximum: float = setting(
        0.025,
        "",
        "a load with a larger relative standard error is unavailable: 5 % is two of them",
        0.005,
        0.5,
    )
    load_trains_minimum: int = setting(
        8, "", "trains of known weight that a calibration needs; its error is too uncertain with fewer", 2
    )
    # files of the analysis
    axle_patterns: str = setting(
        "config/vehicles/axle_patterns.yaml", "", "axle patterns of known trains, from the folder of the run"
    )
    assets: str = setting("config/passages", "", "folder of clusters and load calibrations, from the folder of the run")
    train_data_tolerance: float = setting(
        90.0, "s", "a train of trains.csv belongs to a passage within this time", 1.0, 3600.0
    )
    # continuous loggers
    chunk: float = setting(10.0, "s", "a continuous file is read in pieces of this length", 1.0)
    gap: float = setting(4.0, "s", "quiet time that separates two passages", 0.5)
    margin: float = setting(1.0, "s", "kept before the first and after the last axle", 0.1)
    longest: float = setting(180.0, "s", "longest passage that is kept in memory", 10.0)
    # clusters
    cluster_maximum: int = setting(20, "", "largest number of clusters that BIC may choose", 1, 200)
    cluster_seed: int = setting(7, "", "seed of the mixture fit", 0)
