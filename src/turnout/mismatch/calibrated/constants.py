"""Numeric constants of the calibrated model in one place, each with its unit, its reason and its source."""

from dataclasses import dataclass

from turnout.mismatch.engine.thresholds import threshold

PAGE = "decisions/calibrated-model.md"


@dataclass(frozen=True)
class CalibrationConstants:
    """Constants of the recursive estimate. ``CALIBRATION`` is the only instance in use."""

    repeated_error_share: float = threshold(
        0.9, "share of the tolerated variance", "that repeats in all recordings of a group; not yet measured", PAGE
    )
    level_visits: float = threshold(
        1.0, "visits", "that the stated variance of errors counts as, beside what a turnout has shown of its own", PAGE
    )
    least_known_share: float = threshold(
        1e-3, "share of the information of the file", "below which recordings tell nothing of a direction", "numerical"
    )
    max_chance: float = threshold(1e-4, "probability", "that an innovation of an intact visit is larger", PAGE)
    speed_step: float = threshold(10.0, "km/h", "trains of one type within it share the error of the model", PAGE)
    walk_sds: tuple[tuple[str, float], ...] = threshold(
        (("ballast", 0.03), ("ballast_damper", 0.05), ("pad", 0.02), ("pad_damper", 0.04), ("gain", 0.003)),
        "ln per root year", "random walk of a group of parameters: ageing of ballast, pads and sensors", PAGE,
    )  # fmt: skip
    default_walk_share: float = threshold(0.1, "prior sd per root year", "random walk of all other parameters", PAGE)
    least_sizes: tuple[tuple[str, float], ...] = threshold(
        (("ballast", 0.2), ("pad", 0.35), ("gain", 0.08), ("seat", 0.1), ("depth", 0.3), ("preload", 0.2),
         ("hardening", 0.2)),
        "unit of the group", "deviations from the file below which nobody would act", PAGE,
    )  # fmt: skip
    model_errors: tuple[tuple[str, float], ...] = threshold(
        (
            ("depth", 0.1), ("ballast", 0.04), ("ballast_damper", 0.05), ("pad", 0.02), ("pad_damper", 0.06),
            ("sleeper", 0.03),
        ),
        "unit of the group", "of a value, the same in all recordings: the wheels of all trains meet a nose of one "
        "shape; supports of 10 intact crossing sites have errors beyond their standard deviations", PAGE,
    )  # fmt: skip
    model_errors_beyond_sensors: tuple[tuple[str, float], ...] = threshold(
        (("pad", 0.1),),
        "unit of the group", "of a value beyond the outer sensors: pads there absorb what lies farther out; of 60 "
        "intact sites of plain track", PAGE,
    )  # fmt: skip
    sensor_reach: float = threshold(
        0.3, "m", "beyond a sensor or impact, within which a support is beside it: half a bay", PAGE
    )
    pad_visit_sd: float = threshold(
        0.1, "ln", "change of all pads between visits by their temperature: 30 K at 0.3 % per kelvin", PAGE
    )
    load_effect_sd: float = threshold(
        0.7, "ln", "prior of all pads or all ballast under trains over those under impacts: a factor of two", PAGE
    )
    linear_error: float = threshold(
        0.25,
        "share of the size",
        "of an effect under load, of which visits are linear: ln stiffness or compliance",
        PAGE,
    )
    size_error: float = threshold(
        0.1, "share of the size", "of a change: a constant error of the model cancels only where the value stays", PAGE
    )
    change_sds: float = threshold(5.0, "prior sd", "prior standard deviation of a change of a parameter", PAGE)
    dip_sd: float = threshold(5e-4, "m", "prior standard deviation of the depth of a dip that appears", PAGE)
    least_dip: float = threshold(1e-4, "m", "depth of a dip below which nobody would act", PAGE)
    dip_lengths: tuple[float, ...] = threshold((0.4, 0.6, 0.8), "m", "lengths of the dips that are sought", PAGE)
    dip_spacing: float = threshold(0.1, "m", "distance of the positions at which a dip is sought", PAGE)
    dip_error: float = threshold(1e-5, "m", "error of the surface that waves make of a dip of any depth", PAGE)
    dip_step: float = threshold(
        0.02, "m", "step of the surface from which the waves of a dip are computed", "numerical"
    )
    max_stretch: int = threshold(6, "supports", "adjacent ones that change together: 3 m of track", PAGE)
    gap_shares: tuple[float, ...] = threshold(
        (0.0, 0.25, 0.5, 0.75, 1.0), "share", "of the softening under impacts that remains under trains above a gap: "
        "all of it where no train closes the gap", PAGE,
    )  # fmt: skip
    soft_damper_shares: tuple[float, ...] = threshold(
        (0.0, 0.25, 0.5, 0.75, 1.0), "share", "of the change of ln stiffness that the damper of a softer bed has: a "
        "half in the effects of the library, but any may be; beside a gap it has all of it", PAGE,
    )  # fmt: skip
    gap_size_sds: float = threshold(
        10.0, "prior sd or size", "of a softening whose share under trains is asked: wide, to favour no share", PAGE
    )
    nose_reach: float = threshold(
        0.6, "m", "from a nose, within which the surface is that of the nose: published lengths are 0.5 to 1.2 m", PAGE
    )
    nose_error: float = threshold(
        1.5e-4, "m", "of the file's surface of a nose over the shortest dip: a fifth of a depth of 0.4 to 1.6 mm", PAGE
    )
    nose_start_sds: float = threshold(
        2.0, "prior sd", "of the position of a nose, from which fits begin to either side of that of the file", PAGE
    )
    max_new_steps: int = threshold(6, "steps", "of a fit that begins at the values which earlier visits predict", PAGE)
    min_new_gain: float = threshold(0.5, "nats", "of such a step, below which it is the last", PAGE)
    finding_sds: float = threshold(3.0, "standard deviations", "beyond which a value differs from the file", PAGE)
    least_support: float = threshold(
        0.1, "share", "of its stiffness, below which ballast carries nothing: the sleeper hangs", PAGE
    )
    min_explained_share: float = threshold(
        0.5, "share of the excess", "of the innovation of its first visit, that an effect explains at least", PAGE
    )
    worn_depth: float = threshold(
        0.7, "ln", "a dip that is certainly twice as deep as in the file is a finding, whatever its tolerance", PAGE
    )
    min_prior_share: float = threshold(
        1e-9, "share of the prior variance", "of a mean over components, below which data say nothing", "numerical"
    )
    interval_probability: float = threshold(0.95, "probability", "of the interval of an onset", "convention")


CALIBRATION = CalibrationConstants()
