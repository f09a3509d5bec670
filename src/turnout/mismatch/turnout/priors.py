"""Numeric constants of the case of a turnout, each with its unit, its reason and its source.

Standard deviations of priors, limits of observations and searches, steps of computations. Settings that users change
are in ``turnout.config.settings.mismatch``. A source is a page below ``docs``, a publication, or one word: "convention"
(a usual value), "numerical" (accuracy or time of a computation).
Those of running surface and wheels are in ``surface_priors``, those of the search for defects in ``defect_priors``.
"""

import math
from dataclasses import dataclass

from turnout.mismatch.engine.thresholds import threshold as prior

LOCAL_RAIL = "decisions/local-rail-properties.md"
CROSSING_PANELS = "decisions/crossing-panels.md"
COMMON_PARAMETERS = "decisions/common-parameter-derivatives.md"
ERROR_MODES = "decisions/marginalized-errors.md"
WHEEL_ROUGHNESS = "decisions/wheel-roughness-errors.md"
RUNNING_SURFACE = "decisions/running-surface-priors.md"
WEIGHTING = "decisions/exponential-weighting.md"
FRICTION = "decisions/friction-secant-rate.md"
JOINT_RECEPTANCE = "decisions/joint-receptance-evidence.md"
RADAU_SCHEME = "decisions/radau-scheme.md"
SATURATED = "decisions/saturation-from-impacts.md"
LOCATED = "decisions/residual-localization.md"
PRESCREEN = "decisions/hammer-prescreen.md"
MINIMA = "decisions/minima-of-hammer-fits.md"
GUIDE = "mismatch.md"
SWITCH_PANELS = "decisions/switch-panels.md"
CHANNELS = "decisions/identity-of-channels.md"
SUPPORTS = "decisions/positions-of-supports.md"
KNOTHE, OSCARSSON = "Knothe and Grassie 1993", "Oscarsson 2002"


# fmt: off
@dataclass(frozen=True)
class TrackPriors:
    """Track, sensors and wheelsets of the base model."""

    common_stiffness_sd: float = prior(
        0.25, "ln", "of pads or ballast of the whole track: spread of published values", KNOTHE)
    common_damping_sd: float = prior(
        0.5, "ln", "of pads or ballast of the whole track: spread of published values", KNOTHE)
    common_mass_sd: float = prior(0.06, "ln", "of all sleepers: spread of published values", KNOTHE)
    common_bound: float = prior(
        2.0, "ln", "largest deviation of a value of the whole track: a factor of seven", "numerical")
    support_stiffness_sd: float = prior(0.10, "ln", "scatter of pads or ballast from support to support", OSCARSSON)
    support_damping_sd: float = prior(
        0.15, "ln", "scatter from support to support: dampers were never measured singly", OSCARSSON)
    support_mass_sd: float = prior(0.03, "ln", "scatter of sleepers: they are cast alike", OSCARSSON)
    support_position_sd: float = prior(
        0.01, "m", "of a single sleeper from its place in the file: tolerances of new track are 1 to 2 cm",
        SUPPORTS)
    support_position_step: float = prior(
        0.005, "m", "of a difference quotient by the position of a support", "numerical")
    rail_bending_sd: float = prior(
        0.015, "ln", "bending stiffness of the rail: wear and rolling tolerances", ERROR_MODES)
    rail_shear_sd: float = prior(
        0.12, "ln", "shear stiffness: published coefficients are 0.34 to 0.41; 14 controls of another simulator",
        ERROR_MODES)
    rail_shear_model_sd: float = prior(
        0.13, "ln", "error of the model in a fitted shear stiffness: rms of 14 and of 9 sites of another simulator",
        ERROR_MODES)
    sleeper_mass_model_sd: float = prior(
        0.06, "ln", "the same of all sleepers: rms of 9 sites whose pads are wide and whose sleepers are coupled",
        ERROR_MODES)
    casting_sds: tuple[float, float] = prior(
        (0.10, 0.30), "ln", "stiffness and mass of inner and end pieces: the file has one section for a casting",
        CROSSING_PANELS)
    bound_sds: float = prior(
        6.0, "prior sd", "largest deviation of values of single supports, of the rail and of the surface", "numerical")
    wheels_sd: float = prior(
        0.06, "ln", "unsprung mass: reprofiling takes 10 %; 42 wheelsets of another simulator scatter by 0.054",
        "convention")
    wheels_bound: float = prior(
        0.5, "ln", "largest deviation of an unsprung mass: beyond, it is an effect", "numerical")
    gain_sd: float = prior(0.02, "-", "gain of a sensor: calibration", "convention")
    seat_sd: float = prior(0.02, "m", "position of a sensor along the rail", ERROR_MODES)
    toe_sd: float = prior(0.03, "m", "toe of a blade: drawing, creep and temperature", SWITCH_PANELS)
    load_sd: float = prior(0.05, "-", "sprung mass whose load was measured or noted, as a share of it", "convention")
    load_bound_sds: float = prior(
        2.0, "prior sd", "bounds of an unknown load: a seventh beyond empty and full", "convention")
    min_piece_length: float = prior(0.02, "m", "shorter pieces of a casting between two ends are ignored", "numerical")
    section_ramp: float = prior(0.3, "m", "over which the section of a casting grows at its ends", CROSSING_PANELS)
    rail_step: float = prior(
        0.05, "ln", "grid of rail values about which receptances are linear; derivatives by pads err by 8 % over 0.12",
        JOINT_RECEPTANCE)
    support_reach: float = prior(
        1.9, "m", "beyond sensors and impacts: supports there have values of their own", COMMON_PARAMETERS)
    casting_reach: float = prior(
        6.0, "m", "beyond sensors and impacts: pieces of a casting there have values of their own: its ends reflect",
        CROSSING_PANELS)
    effect_reach: float = prior(
        0.7, "m", "beyond sensors and impacts: supports there may have an effect; those farther out absorb all beyond",
        LOCATED)
    track_margin: float = prior(18.0, "m", "of track that is modelled beyond sensors and impacts", "numerical")
    extra_supports: int = prior(8, "supports", "beyond the zone that a change of the whole track includes", LOCATED)


@dataclass(frozen=True)
class AcceptedPriors:
    """Effects that were accepted into a track's file."""

    sd_share: float = prior(
        0.5, "-", "prior sd of an accepted value over its distance from neutral: it may grow", GUIDE)
    max_neutral_ratio: float = prior(
        100.0, "-", "a neutral value above this multiple of the accepted one means no limit", "convention")
    min_errors: float = prior(3.0, "standard errors", "least prior sd of an accepted value", "convention")
    min_sd_share: float = prior(1e-3, "share of the bounds", "least prior sd of an accepted value", "numerical")
    derivative_step: float = prior(
        0.02, "prior sd", "step of the difference quotient by an accepted value", "numerical")


@dataclass(frozen=True)
class CasePriors:
    """When the base of a case is computed again, and which effects it can test."""

    update_threshold: float = prior(
        0.15, "ln", "change of unsprung mass or rail from which errors are new: a fifth of a response near P2",
        WHEEL_ROUGHNESS)
    max_hammer_distance: float = prior(
        8.0, "m", "from impact to sensor: beyond, the model error leaves a thirtieth of the information", ERROR_MODES)
    min_timed_correlation: float = prior(
        0.25, "-", "above it the time of a train is certain; at wrong times it reaches 0.10", RUNNING_SURFACE)


@dataclass(frozen=True)
class ReceptancePriors:
    """Receptances of hammer tests, their lines and their errors."""

    lowest_line: float = prior(35.0, "Hz", "of the lines, below the ballast resonance", "convention")
    highest_line: float = prior(900.0, "Hz", "of the lines, above the railpad resonance", "convention")
    pinned_pinned_share: float = prior(
        0.85, "share of the pinned-pinned frequency",
        "above which no line is used: an error of 3 % of that frequency changes a receptance by 0.2", ERROR_MODES)
    n_lines: int = prior(44, "lines", "in geometric steps of 8 % between these two", "numerical")
    line_step: float = prior(2.0, "Hz", "to which lines are rounded", "numerical")
    decay_rate: float = prior(
        20.0, "1/s", "records are weighted by exp(-rate t), so that ringing at their end is not truncated", WEIGHTING)
    min_impacts: int = prior(2, "impacts", "accepted ones of a channel, at least", "convention")
    min_lines: int = prior(8, "lines", "that can be used of a channel, at least", "convention")
    max_relative_error: float = prior(0.3, "-", "scatter between impacts beyond which a line is not used", "convention")
    max_band_share: float = prior(
        0.9, "share of the band edge", "of the force spectrum, above which a line is not used", "convention")
    effective_share: float = prior(0.7, "-", "of the lines that count as independent", "convention")
    delay_sd: float = prior(8e-6, "s", "delay of a pair: 2 degrees at 700 Hz", ERROR_MODES)
    smoothing_octaves: float = prior(0.3, "octaves", "correlation length of model errors", ERROR_MODES)
    doubling_distance: float = prior(
        1.5, "m", "that doubles the error variance, by errors of wave speed and decay", ERROR_MODES)
    line_share: float = prior(0.4, "share of the tolerance", "that is independent from line to line", ERROR_MODES)
    magnitude_octaves: float = prior(
        0.34, "octaves", "to either side over which the local magnitude is taken: a third", "convention")
    lowest_band: float = prior(31.25, "Hz", "start of the octave bands of a residual", "convention")
    broad_error: float = prior(
        0.1, "-", "relative error in the first, broad fit: its optimum has a wide basin", PRESCREEN)
    n_drawn_starts: int = prior(4, "starts", "drawn from the priors, of the fit to all tests together", MINIMA)
    lifting_rate: float = prior(5e3, "Hz", "steps of an impact that opens slide chairs: five for a period", "numerical")
    lifting_error: float = prior(
        0.5, "share of the change", "by chairs that open, rms of 167 receptances of twelve panels",
        SWITCH_PANELS)
    tangent_motion: float = prior(1e-6, "m", "under an impact, for the secant of a port", FRICTION)
    bilinear_share: float = prior(
        1e-3, "-", "least difference of the stiffness under pressure and pull, over their sum", "numerical")
    free_rate: float = prior(
        0.021, "m/s", "sliding rate of a free joint under an impact: friction of 0.3 kN fits best with 20 mm/s",
        FRICTION)
    stuck_rate: float = prior(
        1.5e-3, "m/s", "sliding rate of a stuck joint under an impact: friction of 8 kN fits best with it", FRICTION)
    sticking_force: float = prior(
        2e3, "N", "friction force between a free and a stuck joint, for impacts of 5 kN", FRICTION)
    change_octaves: float = prior(
        0.5, "octaves", "correlation length of a change that varies slowly; a quarter and one octave locate alike",
        LOCATED)
    least_filter: float = prior(
        1e-3, "-", "variance of a combination of frequencies over that of the strongest; less changes nothing",
        "numerical")
    max_stretch: int = prior(3, "supports", "next to each other at which one unnamed cause may act", LOCATED)
    relative_step: float = prior(
        1e-3, "-", "change of a support's value, for derivatives of links that follow it", "numerical")
    seat_step: float = prior(0.01, "m", "of the derivative by the position of a sensor", "numerical")
    toe_step: float = prior(1e-7, "m", "of the change of the matrices by the position of the toe", "numerical")


@dataclass(frozen=True)
class PassagePriors:
    """Passages as observations: band, samples and errors."""

    own_steps: int = prior(2, "steps", "to time, speed and load of a passage that is linear about a fit", "numerical")
    shortest_wave: float = prior(
        0.3, "m", "of the modelled roughness of the rail: shorter waves are not fitted", ERROR_MODES)
    band_low: float = prior(5.0, "Hz", "lower end of the band of a passage", ERROR_MODES)
    band_high: float = prior(
        112.0, "Hz", "upper end of the band in which the deterministic part dominates the roughness", ERROR_MODES)
    rate_divisors: tuple[int, ...] = prior(
        (9, 6, 5), "-", "simulation steps per sample of an observation; the first that suffices is used", "numerical")
    clear_distance: float = prior(
        5.0, "m", "to a wheel, for a channel's noise: at 4.2 m there is noise alone, at 1.4 m six times as much",
        ERROR_MODES)
    record_margin: float = prior(0.02, "s", "at both ends of a recording that is no noise", "convention")
    min_quiet_time: float = prior(0.1, "s", "without a wheel, at least, for a channel's noise", "convention")
    hum_time: float = prior(
        0.5, "s", "before and behind a train, at most, that tell frequency and phase of hum: mains drift", "convention")
    mains_sd: float = prior(
        0.03, "Hz", "deviation of the mains: the European grid keeps 0.05 Hz in ordinary operation", "convention")
    mains_range: float = prior(4.0, "prior sd", "largest deviation of the mains that is tried", "numerical")
    mains_steps: float = prior(20.0, "-", "trial frequencies of a line for each Hz and second", "numerical")
    line_periods: float = prior(2.0, "periods", "of a steady line in a stretch without a wheel, at least", "convention")
    line_band: float = prior(10.0, "Hz", "to either side of a line, whose power it is compared with", "convention")
    line_step: float = prior(0.5, "Hz", "between trial frequencies of such a line, in stretches of half a second",
                             "numerical")
    most_explained: float = prior(0.999, "-", "share of a channel's power by a line, at most", "numerical")
    clear_share: float = prior(
        0.17, "share of the rms response", "of a line without a wheel that is reported, as of a clear effect",
        "convention")
    clipping_blur: float = prior(0.03, "s", "about a sample at the range, which is disturbed by clipping", "numerical")
    range_share: float = prior(0.999, "share of the range", "from which a sample counts as clipped", "numerical")
    coupling_corner_sd: float = prior(0.7, "Hz", "lower corner of an amplifier without a data sheet", ERROR_MODES)
    chatter_share: float = prior(
        0.1, "share of the rms", "error of a sample where a blade lies on slide chairs: it chatters after a wheel",
        "decisions/switch-panels.md")
    noise_floor_share: float = prior(0.02, "share of the rms", "least error of a sample", "convention")
    effective_share: float = prior(0.35, "-", "of the samples that count as independent", "convention")
    min_read_rate: float = prior(2500.0, "Hz", "at which cubic interpolation is right to 0.03 % at 112 Hz", "numerical")
    min_samples_per_period: float = prior(
        3.0, "samples", "of the shortest period of the band, whose edge ends at 1.25 times that: Nyquist needs 2.5",
        "numerical")
    min_samples: int = prior(20, "samples", "of a passage, at least", "convention")
    amplitude_window: int = prior(31, "samples", "over which the local amplitude is taken", "convention")
    speed_sd: float = prior(0.004, "-", "relative error of the speed after alignment", RUNNING_SURFACE)
    time_sd: float = prior(1.5e-3, "s", "error of the time after alignment", RUNNING_SURFACE)
    cell_reach: float = prior(
        3.0, "m", "from an axle to a sensor within which a sample belongs to the axle's cells", LOCATED)
    cell_length: float = prior(0.6, "m", "of a cell of the residual: one sleeper bay", LOCATED)
    ridge_share: float = prior(
        0.02, "share of the largest power", "that regularises the reconstruction of a force", "numerical")
    max_wheel_distance: float = prior(6.0, "m", "of the nearest wheel as a covariate of a latent force", "convention")


@dataclass(frozen=True)
class SimulationPriors:
    """Simulation of passages in fits, and the linear responses beside it."""

    rate: float = prior(1800.0, "Hz", "of the simulation; errors 1 to 2 % of the waveform with Radau IIA", RADAU_SCHEME)
    elements_per_bay: int = prior(
        2, "elements", "of the rail per bay: 0.2 to 0.5 % of the waveform below 112 Hz from 4", RADAU_SCHEME)
    decay_exponent: float = prior(
        8.0, "-", "at which a force's effect along the rail is cut off in a step; error 3e-6", RADAU_SCHEME)
    lead_time: float = prior(0.25, "s", "before the first wheel reaches the first sensor", "numerical")
    edge_time: float = prior(0.08, "s", "of signal before the first and after the last wheel", "numerical")
    signal_cache_size: int = prior(150, "passages", "whose signals are kept", "numerical")
    probe_cache_spare: int = prior(
        4, "passages", "with probes that are kept beyond the number of passages", "numerical")
    sensitivity_cache_size: int = prior(8, "tracks", "whose receptances are kept", "numerical")
    rail_cache_size: int = prior(9, "rails", "whose tracks are kept", "numerical")
    simulator_cache_size: int = prior(12, "tracks", "whose factorisations are kept", "numerical")
    transfer_cache_size: int = prior(12, "responses", "of the track to forces that are kept", "numerical")
    template_cache_size: int = prior(
        24, "templates", "of matrices that are kept, and rails and link sets of each", "numerical")
    log_step: float = prior(0.004, "ln", "of the difference quotient by masses, stiffness and damping", "numerical")
    load_step: float = prior(0.003, "-", "of the difference quotient by a load", "numerical")
    time_step: float = prior(1e-5, "s", "of the difference quotient by the time of a passage", "numerical")
    surface_step: float = prior(
        0.002, "m or ln", "of the difference quotient by a number of the running surface", "numerical")
    lowest_line: float = prior(4.0, "Hz", "of the transfer functions of a passage", "numerical")
    line_step: float = prior(2.0, "Hz", "of the transfer functions of a passage", "numerical")
    band_margin: float = prior(1.3, "-", "highest line of the transfer functions over the end of the band", "numerical")
    node_stride: int = prior(2, "nodes", "every second one is used; in between a force is shared linearly", "numerical")
    node_margin: float = prior(0.3, "m", "of nodes beyond the free waves", "numerical")
    difference_reach: float = prior(
        0.5, "prior sd", "of a value, within which a difference quotient is used again; fits stall at 1", "numerical")
    switch_step_factor: float = prior(
        10.0, "-", "of these steps in a switch, where contacts open and close: smaller ones are noise", "numerical")
    clock_share: float = prior(
        0.2, "-", "of that reach for time and speed of a passage: 0.15 ms are 5 degrees at 100 Hz", "numerical")
    difference_cache_size: int = prior(600, "quotients", "that are kept", "numerical")
    difference_size: float = prior(
        0.4, "ln", "of the size of an effect that counts as a prior sd there: a fifth of it", "numerical")
    max_in_switch: int = prior(
        5000, "simulations", "of a passage over a switch in one search beside its base fit: a quarter of a CPU hour",
        "decisions/switch-panels.md")
    path_step: float = prior(0.01, "m", "of a fine path", "numerical")
    transfer_step: float = prior(
        0.002, "m", "between trial positions where a wheel first and last touches two rails", "numerical")
    transfer_samples: int = prior(
        21, "samples", "of the change of rail and of a weight over an interval", "numerical")
    ring_time: float = prior(0.35, "s", "ringing of the track after the last wheel", LOCAL_RAIL)
    averaging_length: float = prior(
        2.4, "m", "of the rail about a wheel, for waves that are not fitted; 0.6 and 1.2 err near its resonance",
        LOCAL_RAIL)
    ringing_length: float = prior(
        3.0, "m", "beyond each end of the nodes, for a wheel that rings on: 0.3 errs, 6 changes nothing", LOCAL_RAIL)


@dataclass(frozen=True)
class AlignmentPriors:
    """Alignment of passages with their simulation, and the search for the running surface."""

    band_end: float = prior(30.0, "Hz", "of the rail's deflection under the axles", RUNNING_SURFACE)
    min_correlation: float = prior(
        0.65, "-", "of a passage with its train: 0.8 with a dip, 0.6 to 0.7 with a flat, a wrong train at most 0.6",
        RUNNING_SURFACE)
    sample_step: float = prior(1.0 / 800.0, "s", "of signals that are correlated", "numerical")
    max_stretch: float = prior(0.015, "-", "by which the recorded speed may be wrong", "convention")
    n_stretches: int = prior(13, "trials", "of the speed of a passage", "numerical")
    max_trial_passages: int = prior(
        3, "passages", "used, those of the shortest trains; each is simulated 20 times a number, or more", "numerical")
    position_step: float = prior(0.15, "m", "from one trial position to the next", RUNNING_SURFACE)
    max_deviation: float = prior(2.0, "prior sd", "of a trial position", RUNNING_SURFACE)
    trial_factors: tuple[float, ...] = prior(
        (-1.0, -0.5, 0.5, 1.0), "prior sd", "trial changes of other numbers", RUNNING_SURFACE)
    refinement: int = prior(4, "-", "subdivision of the position step in the second round", "numerical")
    n_fine_steps: int = prior(3, "steps", "to each side in the second round", "numerical")
    effective_samples: float = prior(
        20.0, "samples", "independent ones of a passage below 30 Hz: its weight against the prior", RUNNING_SURFACE)
    max_correlation: float = prior(0.999, "-", "a larger one contains no information on the surface", "numerical")


@dataclass(frozen=True)
class ChannelPriors:
    """Which sensor each channel records, from its correlation with the simulation at all sensors."""

    same_sensor: float = prior(
        0.5, "-", "of a channel with the simulation at its own sensor, at least", CHANNELS)
    other_sensor: float = prior(
        0.3, "-", "below it a channel records neither train nor impact where its sensor should be", CHANNELS)
    min_gain: float = prior(
        0.5, "-", "by which two channels correlate better with each other's sensor than with their own", CHANNELS)
    min_passage_scale: float = prior(
        1.3, "-", "factor from which all channels of passages have a wrong scale", CHANNELS)
    min_impact_scale: float = prior(
        2.0, "-", "the same of hammer tests, whose level depends on the track as well", CHANNELS)
    min_side_distance: float = prior(
        0.5, "m", "of sensors on both sides of an impact, at least, to find its position", CHANNELS)
    first_position_step: float = prior(
        0.15, "m", "of an impact from its stated position, at least: nearer ones change no answer", CHANNELS)
    position_step: float = prior(0.05, "m", "of the further steps", "numerical")
    max_position_step: float = prior(0.6, "m", "of an impact from its stated position, at most: a bay", CHANNELS)
    min_position_gain: float = prior(
        0.05, "-", "of the mean correlation at another position, while that of every channel rises", CHANNELS)
    min_test_scale: float = prior(
        3.0, "-", "factor by which one hammer test deviates from the median of all; right ones by at most 1.8",
        CHANNELS)
    min_tests: int = prior(
        3, "hammer tests", "at least, to compare their amplitudes with each other", CHANNELS)
    min_delay: float = prior(
        2.5e-4, "s", "by which the accelerations of all channels lag behind the force, or lead it", CHANNELS)
    delay_spread: float = prior(3e-4, "s", "within which channels and tests share one delay", CHANNELS)
    max_delay: float = prior(5e-3, "s", "that is sought", "convention")
    delay_step: float = prior(2e-5, "s", "between trial delays: 6 degrees at the highest line", "numerical")
    scale_spread: float = prior(
        2.0, "-", "within which the channels of a wrong scale share one factor", CHANNELS)
    unit_tolerance: float = prior(
        1.4, "-", "within which that factor is the one of two units", CHANNELS)


@dataclass(frozen=True)
class SupportPositionPriors:
    """Where all supports are, from the fits to the hammer tests."""

    n_positions: int = prior(6, "positions", "of all supports in a bay that are tried", "numerical")
    min_gain: float = prior(
        6.0, "nats", "by which hammer tests fit better with all supports elsewhere: the lead of a name", SUPPORTS)
    min_explained: float = prior(
        0.6, "-", "of the variance of this evidence along a bay, by one wave in the bay", SUPPORTS)
    offset_sd: float = prior(0.02, "m", "error of the distance: rms of 63 opened cases, 1.2 to 1.8 cm", SUPPORTS)


@dataclass(frozen=True)
class SaturationPriors:
    """Saturated channels, from peaks of impacts and of passages."""

    min_impacts: int = prior(
        3, "impacts", "accepted ones of a test, at least, to estimate its level and scatter", SATURATED)
    scatter_floor: float = prior(
        0.02, "ln", "least scatter of peaks: sampling, ringing mountings, impacts beside the mark", SATURATED)
    near_impact_distance: float = prior(
        0.3, "m", "half a bay: a sensor this near the impact measures the motion there", SATURATED)
    min_limit_share: float = prior(
        0.9, "share of the largest peak", "of the channel that a limit reaches at least", SATURATED)
    limit_step: float = prior(0.25 * 0.02, "ln", "between trial limits: a quarter of the least scatter", "numerical")
    min_passages: int = prior(4, "passages", "at least, for a limit from passages", SATURATED)
    min_sensors: int = prior(3, "sensors", "at least, for a limit from passages", SATURATED)
    top_share: float = prior(0.8, "share of the peak", "above which a clipped channel stays for long", SATURATED)
    filter_ringing: float = prior(
        math.pi / 4.0, "-", "limit over peak of a clipped wave, of which a recorder's filter passes the first harmonic",
        SATURATED)
    min_side_ratio: float = prior(
        0.9, "-", "limit of one side of an amplifier over that of the other, at least", SATURATED)
    limit_sd: float = prior(0.1, "-", "relative error of the limit: both sides of an amplifier differ", SATURATED)
    level_time: float = prior(0.1, "s", "over which levels of channels are compared", CHANNELS)
    min_level_correlation: float = prior(
        0.5, "-", "of the level of a channel with that of the others: without it noise reaches its peaks", CHANNELS)


@dataclass(frozen=True)
class DisturbancePriors:
    """Passages in which another source shakes the sensors."""

    wheel_distances: tuple[float, ...] = prior(
        (12.0, 17.0, 24.0, 34.0, 48.0), "m",
        "of the nearest wheel from the sensors, where stretches begin: each reaches half as far again", LOCATED)
    car_length: float = prior(26.0, "m", "a train that does not match its file may be longer by a car", "convention")
    min_quiet_time: float = prior(0.15, "s", "of the shortest segment that is tested", LOCATED)
    record_margin: float = prior(0.02, "s", "at both ends of a recording that is not tested", "convention")
    band: tuple[float, float] = prior((5.0, 100.0), "Hz", "of the level", LOCATED)
    min_excess: float = prior(
        3.0, "dB", "over the other passages with wheels as far away; undisturbed ones differ by 1 dB", LOCATED)
    train_difference: float = prior(
        10.0, "dB", "between trains, by the roughness of their wheels: one passage shows another source beyond it",
        "Thompson 2009")
    hann_correlation: float = prior(
        1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0), "-", "variance factor of correlated lines of a Hann window", "Welch 1967")
    max_chance: float = prior(1e-4, "probability", "that it is chance, over all segments", LOCATED)


# fmt: on
TRACK = TrackPriors()
ACCEPTED = AcceptedPriors()
CASE = CasePriors()
RECEPTANCE = ReceptancePriors()
PASSAGE = PassagePriors()
SIMULATION = SimulationPriors()
ALIGNMENT = AlignmentPriors()
CHANNELS_CHECK = ChannelPriors()
SUPPORT_POSITIONS = SupportPositionPriors()
SATURATION = SaturationPriors()
DISTURBANCE = DisturbancePriors()
