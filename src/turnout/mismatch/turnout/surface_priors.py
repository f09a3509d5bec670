"""Numeric constants of running surface, wheels and roughness, as those of ``priors``."""

from dataclasses import dataclass

from turnout.mismatch.engine.thresholds import threshold as prior

CROSSING_PANELS = "decisions/crossing-panels.md"
ERROR_MODES = "decisions/marginalized-errors.md"
RAIL_ROUGHNESS = "decisions/rail-roughness-parameters.md"
RUNNING_SURFACE = "decisions/running-surface-priors.md"
FITS = "decisions/joint-fit-convergence.md"


# fmt: off
@dataclass(frozen=True)
class SurfacePriors:
    """Uncertain numbers of blade, nose and joints."""

    shape_sd: float = prior(
        0.25, "ln", "power of a kink with an estimated depth: 1.2 to 3.3, from a V to a cusp", RUNNING_SURFACE)
    max_step_sd: float = prior(3.0, "prior sd", "by which a position may move in one fit step", FITS)
    max_relative_step: float = prior(
        0.3, "share of the length", "by which a component may move in one fit step: the derivative is local",
        RUNNING_SURFACE)
    min_depth: float = prior(1e-6, "m", "shallower components are ignored", "numerical")
    model_error: float = prior(
        0.1, "ln", "the same at every axle: with long trains depth was 15 % and length 19 % too small", RUNNING_SURFACE)
    model_position_error: float = prior(
        0.02, "m", "the same at every axle: with long trains a position was 4 cm off", RUNNING_SURFACE)
    max_error_ratio: float = prior(0.5, "prior sd", "largest error of a number that is reported", RUNNING_SURFACE)
    min_deviation_ratio: float = prior(
        2.0, "prior sd and errors", "from which a number is reported whatever its error", RUNNING_SURFACE)
    min_data_share: float = prior(
        0.5, "share of the information", "on a number that is attributed to the recordings, at least", RUNNING_SURFACE)
    grid_step: float = prior(0.02, "m", "at which components are looked at near the sensors", "numerical")
    gradient_step: float = prior(
        1.0, "prior sd", "of the difference quotient by a number of a top: positions are to 3 mm", "numerical")


@dataclass(frozen=True)
class TopShapePriors:
    """Error of the shape of the tops of stock rail and blade where wheels change."""

    correlation_length: float = prior(
        0.4, "m", "of the error along the rail: shorter ones are roughness, longer ones the numbers of the top",
        "decisions/switch-panels.md")
    reach: float = prior(1.0, "m", "from the change, beyond which wheels press one rail alone", "convention")
    step: float = prior(0.02, "m", "between samples of the error", "numerical")
    kept_variance: float = prior(0.9, "share of the variance", "in the modes that are kept", "numerical")
    difference_step: float = prior(0.3, "sd", "of the difference quotient by the amplitude of a mode", "numerical")


@dataclass(frozen=True)
class WheelPriors:
    """Roughness and profile of single wheels: error modes of a passage."""

    depth_sd: float = prior(0.2, "-", "relative depth of a component from wheel to wheel", CROSSING_PANELS)
    length_sd: float = prior(0.15, "-", "relative length of a component from wheel to wheel", CROSSING_PANELS)
    position_sd: float = prior(0.03, "m", "position of a component from wheel to wheel", CROSSING_PANELS)
    sharpness_sd: float = prior(
        0.5, "-", "shape of a component, as a share of the difference between powers 1.5 and 2", CROSSING_PANELS)
    slope_length: float = prior(0.02, "m", "over which the slope of a top is taken", "numerical")
    deviation_step: float = prior(0.3, "sd", "of the difference quotient by a deviation of all wheels", "numerical")
    sharing_time: float = prior(
        0.03, "s", "to either side, over which the power of a wheel's response is averaged: half a bogie at 40 m/s",
        "numerical")
    max_nose_length: float = prior(1.0, "m", "to either side of the deepest point", CROSSING_PANELS)
    min_depth: float = prior(1e-6, "m", "shallower components are ignored", "numerical")
    out_of_round_sd: float = prior(1.5e-5, "m", "first three harmonics of wheels in service", "Johansson 2006")
    level: float = prior(-2.0, "dB", "over the limit curve of rails: disc-braked wheels", "convention")
    min_mode_variance: float = prior(
        0.02, "share of the variance", "of a sample below which a mode is left out", "numerical")
    factor_tolerance: float = prior(
        0.025, "share of that", "that the factor of the modes may leave in no wave", "numerical")
    faint_share: float = prior(
        0.1, "share of that", "single waves below it are left out before they are combined", "numerical")
    roughness_margin: float = prior(
        6.0, "m", "beyond the free waves; lightly damped track carries a wheel's noise that far", ERROR_MODES)


@dataclass(frozen=True)
class RoughnessPriors:
    """Free waves of the rail's roughness."""

    rolling_reach: float = prior(
        3.0, "m", "before the first and behind the last sensor, from where a wheel still excites them", RAIL_ROUGHNESS)
    longest_wave: float = prior(3.0, "m", "of the free waves", RAIL_ROUGHNESS)
    shortest_wave: float = prior(
        0.25, "m", "of the free waves: those below 0.3 m are beyond the band, and widen into it at a passing wheel",
        RAIL_ROUGHNESS)
    period_ratio: float = prior(
        1.1, "-", "period of the waves over the length of rail, so that both ends are independent", "numerical")
    fade_length: float = prior(0.8, "m", "over which waves fade at both ends", "numerical")
    path_step: float = prior(0.02, "m", "between samples of the path", "numerical")


# fmt: on
SURFACE = SurfacePriors()
TOP_SHAPE = TopShapePriors()
WHEELS = WheelPriors()
ROUGHNESS = RoughnessPriors()
