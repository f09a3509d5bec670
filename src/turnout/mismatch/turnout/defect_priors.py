"""Numeric constants of the search for defects of wheels and rail, as those of ``priors``."""

from dataclasses import dataclass

from turnout.mismatch.engine.thresholds import threshold as prior

DEFECTS = "decisions/rail-and-wheel-defects.md"
SHORT_WAVES = "decisions/short-wave-corrugation.md"
LOCATED = "decisions/locating-unknown-effects.md"
EFFECT_SIZES = "decisions/blind-effect-sizes.md"


# fmt: off
@dataclass(frozen=True)
class FlatPriors:
    """Wheel flats, from their impacts in the sound level and their signal in the band."""

    low_frequency: float = prior(250.0, "Hz", "lower end of the level: roughness hides impacts below 100 Hz", DEFECTS)
    high_frequency: float = prior(900.0, "Hz", "upper end of the level", DEFECTS)
    max_frequency_share: float = prior(0.35, "share of the rate", "above, the anti-alias filter may act", "convention")
    bin_time: float = prior(0.002, "s", "of a bin of the level", DEFECTS)
    impact_time: float = prior(0.006, "s", "half width of an impact", DEFECTS)
    background_time: float = prior(0.12, "s", "half width of the background of an impact", DEFECTS)
    radius_changes: tuple[float, ...] = prior(
        (-0.05, 0.031, 0.01), "-", "start, end and step, relative to the file: a wheel is turned down in service",
        DEFECTS)
    phase_step: float = prior(0.06, "m", "between trial phases", DEFECTS)
    comparison_step: float = prior(0.02, "m", "between positions where wheels are compared", "numerical")
    min_common: float = prior(2.0, "deviations", "least median over the wheels that is no noise", "convention")
    strengths: tuple[float, ...] = prior(
        (2.0, 4.0, 7.0, 12.0, 20.0), "deviations", "trial levels of an impact beside the sensor", DEFECTS)
    decays: tuple[float, ...] = prior(
        (0.3, 0.8, 1.6, 3.0), "deviations per m", "trial decays of the level along the rail", DEFECTS)
    outlier_share: float = prior(0.05, "share of the data", "that has any other cause", DEFECTS)
    outlier_density: float = prior(1.0 / 20.0, "1 / deviation", "uniform over 20 deviations", DEFECTS)
    impact_scatter: float = prior(0.25, "share of the level", "impacts on a sleeper and between two differ", DEFECTS)
    max_sensor_distance: float = prior(5.0, "m", "farther impacts are masked by nearer wheels", DEFECTS)
    sensor_weight: float = prior(0.5, "-", "sensors measure the same impact: their data count half", DEFECTS)
    max_wheels: int = prior(2, "wheels", "that are proposed at most", DEFECTS)
    max_evidence_gap: float = prior(3.0, "nats", "by which the second may lie behind the first", DEFECTS)
    min_evidence: float = prior(
        3.0, "nats", "of the impacts, less the logarithm of the number of wheels, at least", DEFECTS)
    phase_offsets: tuple[float, ...] = prior(
        (-0.24, 0.25, 0.06), "m", "start, end and step of trial phases about that of the impacts", DEFECTS)
    phase_resolution: float = prior(0.15, "m", "of the phases: closer ones are one trial", DEFECTS)
    fine_phase_offsets: tuple[float, ...] = prior(
        (-0.03, 0.0, 0.03), "m", "trial phases about the best of them", DEFECTS)
    medium_length: float = prior(0.05, "m", "of the flat whose phase is searched first", EFFECT_SIZES)
    lengths: tuple[float, ...] = prior(
        (0.025, 0.035, 0.045, 0.055, 0.07, 0.09), "m", "trial lengths of a flat", EFFECT_SIZES)


@dataclass(frozen=True)
class PolygonPriors:
    """Polygonal wheels with waves in the band of the fit."""

    longest_wave: float = prior(1.0, "m", "limit of the waves searched", DEFECTS)
    n_wavelengths: int = prior(115, "trials", "over 10 m neighbours differ by half a period at most", "numerical")
    fine_factors: tuple[float, float, int] = prior(
        (0.985, 1.015, 13), "-", "lowest, highest and number of factors of the wavelength, for its refinement",
        "numerical")
    amplitudes: tuple[float, float, int] = prior(
        (1e-5, 4e-4, 5), "m", "lowest, highest and number of prior sds of cosine and sine", EFFECT_SIZES)
    angles_per_passage: float = prior(12.0, "angles", "that can be distinguished in a passage", DEFECTS)


@dataclass(frozen=True)
class ShortPolygonPriors:
    """Polygonal wheels with shorter waves, from the sound level."""

    wheel_reach: float = prior(1.2, "m", "from wheel to sensor; axles of a bogie are at least 1.8 m apart", SHORT_WAVES)
    bin_width: float = prior(0.04, "ln", "of a bin of the wavelength", SHORT_WAVES)
    near_offset: float = prior(0.2, "ln", "nearest bins of the background", SHORT_WAVES)
    far_offset: float = prior(0.6, "ln", "farthest bins of the background", SHORT_WAVES)
    resolution: float = prior(0.16, "ln", "of 2.4 m of rail at 0.2 m", SHORT_WAVES)
    wheel_sd: float = prior(0.5, "ln", "level between round wheels; twice that in another simulator", SHORT_WAVES)
    sensor_sd: float = prior(0.8, "ln", "level of one spectrum", SHORT_WAVES)
    polygon_sd: float = prior(2.5, "ln", "level of a polygonal wheel over its neighbours", SHORT_WAVES)
    min_wheels: int = prior(3, "wheels", "of a train, at least, for a median", "convention")


@dataclass(frozen=True)
class GeometryPriors:
    """Dips and corrugation, from the free waves of the rail."""

    position_step: float = prior(0.1, "m", "between trial positions of a dip", DEFECTS)
    sensor_margin: float = prior(1.0, "m", "beyond the sensors that is searched", DEFECTS)
    lengths: tuple[float, ...] = prior((0.25, 0.4, 0.6, 0.9), "m", "trial lengths of a dip", EFFECT_SIZES)
    sharpnesses: tuple[float, ...] = prior((0.2, 0.9), "-", "trial shapes of a dip", DEFECTS)
    resolution: float = prior(0.3, "m", "closer dips cannot be distinguished", DEFECTS)
    unit_depth: float = prior(1e-3, "m", "of a trial dip", "numerical")
    unit_waves: tuple[tuple[float, float], ...] = prior(
        ((1e-5, 0.0), (0.0, 1e-5)), "m", "sine and cosine of trial corrugation", "numerical")
    wavelength_ratio: float = prior(1.02, "-", "shortest trial wavelength over the shortest free wave", "numerical")
    longest_wave: float = prior(0.75, "m", "longest wave of trial corrugation", DEFECTS)
    n_wavelengths: int = prior(40, "trials", "of the wavelength of corrugation", "numerical")
    half_lengths: tuple[float, ...] = prior((1.8, 3.2, 5.0), "m", "half the length of a corrugated stretch", DEFECTS)
    amplitude_sd: float = prior(3e-5, "m", "prior of the amplitude: corrugation that is ground away", EFFECT_SIZES)
    n_independent_waves: float = prior(14.0, "wavelengths", "that can be distinguished by sensors 6 m apart", DEFECTS)
    worn_nose_sharpness: float = prior(
        0.5, "-", "at which the fit of a worn nose starts: between a cosine and a kink", "convention"
    )
    worn_nose_length_sd: float = prior(
        0.3, "share of the length", "of the length of the wear about that of the nose as fitted", "convention"
    )


@dataclass(frozen=True)
class CorrugationPriors:
    """Corrugation with shorter waves, from the sound level."""

    min_wavelength: float = prior(0.05, "m", "limit of the waves searched", SHORT_WAVES)
    bin_width: float = prior(
        0.05, "ln", "of a bin of the wavelength: the resolution of 5 m of rail at 0.2 m", SHORT_WAVES)
    overlap: int = prior(2, "bins", "per width of a bin: a line between two bins is whole in a third", "convention")
    line_bins: int = prior(2, "bins", "to either side over which a line spreads", SHORT_WAVES)
    background_gap: int = prior(2, "bins", "nearest of the background", SHORT_WAVES)
    background_reach: int = prior(6, "bins", "farthest of the background", SHORT_WAVES)
    max_frequency_share: float = prior(0.35, "share of the rate", "above, the anti-alias filter may act", "convention")
    sensor_sd: float = prior(
        0.8, "ln", "level of one sensor on intact rail: 0.62 and 1.0 in two simulators", SHORT_WAVES)
    corrugation_sd: float = prior(2.0, "ln", "prior of the level of corrugation", SHORT_WAVES)
    independent_distance: float = prior(2.0, "m", "closer sensors measure the same rail", SHORT_WAVES)
    half_lengths: tuple[float, ...] = prior((1.0, 1.8, 3.2, 5.0), "m", "half the length of the stretch", SHORT_WAVES)
    amplitudes: tuple[float, float, int] = prior(
        (2e-6, 3e-4, 60), "m", "lowest, highest and number of amplitudes that are tested", SHORT_WAVES)
    response_error: float = prior(0.15, "-", "relative error of the response at one frequency", SHORT_WAVES)
    node_stride: int = prior(2, "nodes", "every second one is used", "numerical")
    phase_step: float = prior(0.4, "rad", "between trial phases, and between trial wavelengths at the end", "numerical")


@dataclass(frozen=True)
class ImpactPriors:
    """Impacts at one position of the track, from the level above the rolling of wheels."""

    low_frequency: float = prior(1700.0, "Hz", "lower end of the level: at 35 m/s waves of 20 mm", LOCATED)
    high_frequency: float = prior(2300.0, "Hz", "upper end of the level, where the rate allows it", LOCATED)
    max_frequency_share: float = prior(0.46, "share of the rate", "above, the flank meets half the rate", "numerical")
    least_width: float = prior(1.15, "-", "upper over lower end of the level, at least", "convention")
    bin_time: float = prior(0.005, "s", "of a bin of the level", LOCATED)
    distances: tuple[float, ...] = prior(
        (0.0, 0.3, 0.6, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0), "m",
        "between which the level of rolling is constant", LOCATED)
    n_sweeps: int = prior(5, "sweeps", "of medians over passages, sensors and distances", "numerical")
    position_step: float = prior(0.3, "m", "between positions, half a sleeper bay", LOCATED)
    half_window: float = prior(0.3, "m", "from a wheel to the position that it excites", LOCATED)
    margin: float = prior(0.6, "m", "beyond the sensors that is searched, one sleeper bay", LOCATED)
    min_wheels: int = prior(5, "wheels", "that must show it: a flat has one, and another beside it", LOCATED)
    level: float = prior(0.4, "ln", "of the fifth loudest wheel on intact track", LOCATED)
    level_sd: float = prior(0.5, "ln", "of that level between positions on intact track", LOCATED)
    impact_sd: float = prior(3.0, "ln", "of that level where something rattles", LOCATED)
    lag: float = prior(0.2, "m", "that a wheel rolls on until the part that it has moved collides", LOCATED)
    position_error: float = prior(0.6, "m", "of the loudest position, one sleeper bay", LOCATED)
    before_known: float = prior(1.0, "m", "before a joint or nose of the file, where a wheel does not count", LOCATED)
    behind_known: float = prior(2.0, "m", "behind it: wheels that have left the rail land there", LOCATED)


# fmt: on
FLATS = FlatPriors()
POLYGONS = PolygonPriors()
SHORT_POLYGONS = ShortPolygonPriors()
GEOMETRY = GeometryPriors()
CORRUGATION = CorrugationPriors()
IMPACTS = ImpactPriors()
