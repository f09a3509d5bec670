"""Numeric constants of the engine in one place, each with its unit, its reason and its source.

Settings that users change are in ``turnout.config.settings.mismatch``. A source is a page below ``docs``, a
publication, or one word: "convention" (a usual value), "numerical" (accuracy or time of a computation; verdicts
do not depend on it as long as fits converge).
"""

from dataclasses import dataclass, field, fields
from typing import Any

FITS = "decisions/joint-fit-convergence.md"
PAIRS = "decisions/two-effects.md"
PARTS = "decisions/effects-of-one-part.md"
ALWAYS = "decisions/candidates-always-tested.md"
PRESCREEN = "decisions/hammer-prescreen.md"
LOCATED = "decisions/residual-localization.md"
GUIDE = "mismatch.md"
CALIBRATED = "decisions/calibrated-model.md"


def threshold(value: Any, unit: str, reason: str, source: str) -> Any:
    """Field of a dataclass with unit, reason and source.

    Parameters
    ----------
    value : number or tuple
        The default.
    unit : str
    reason : str
        What it limits, and why there.
    source : str
        Page below ``docs``, publication, "convention" or "numerical".

    Returns
    -------
    dataclasses.Field
    """
    return field(default=value, metadata={"unit": unit, "reason": reason, "source": source})


@dataclass(frozen=True)
class Thresholds:
    """Numeric constants of the engine. ``THRESHOLDS`` is the only instance in use."""

    # The answer on one effect
    weak_gain: float = threshold(
        2.0, "thresholds", "a weaker name that held-out recordings contradict is no evidence of any effect", FITS
    )
    contradiction_threshold: float = threshold(
        0.5, "thresholds", "a held-out condition that loses less contradicts no name", FITS
    )
    max_loss_share: float = threshold(
        0.2, "share of the gain", "a held-out condition that loses more, and half a threshold, contradicts it", FITS
    )
    max_left_force: float = threshold(
        40.0,
        "nats",
        "evidence for a force that any name may leave at its position: five of six intact turnouts leave less anywhere",
        LOCATED,
    )
    large_value_lead: float = threshold(
        3.0, "nats", "odds of 20 to 1 that a value lies far beyond its prior, beside the number of values", CALIBRATED
    )
    max_bounded_error: float = threshold(
        0.5, "share of the size", "standard error beyond which only a lower limit is known: 95 % reach twice the size",
        PAIRS,
    )  # fmt: skip
    max_ordinary_spreads: float = threshold(
        3.0, "spreads", "similar components differ by less: one in 370 intact ones is beyond", PARTS
    )
    bound_slack: float = threshold(
        1e-9, "share of the bounds", "by which a value at its bound may exceed it", "numerical"
    )
    min_siblings: int = threshold(6, "components", "fewer similar ones give no spread", "convention")
    max_numerical_error: float = threshold(
        1.0 / 9.0, "of the tolerated mean square", "a third of the tolerated error is material", GUIDE
    )

    # Probability of an answer
    prior_none: float = threshold(0.5, "probability", "half of all turnouts have no effect", "convention")
    prior_unknown: float = threshold(0.1, "probability", "effects outside the catalogue are few", "convention")
    prior_families: float = threshold(0.4, "probability", "the rest, spread over all families", "convention")
    unknown_slope: float = threshold(
        2.0, "thresholds", "score of unknown for an e-fold excess that is all unexplained", "convention"
    )
    unknown_share: float = threshold(
        0.2, "share", "of the excess counts for unknown even if a candidate explains all of it", "convention"
    )
    min_probability: float = threshold(1e-3, "probability", "no softmax is taken as surer than this", "convention")
    max_exponent: float = threshold(700.0, "-", "the exponential function underflows beyond", "numerical")

    # Held-out conditions
    min_recordings: int = threshold(3, "recordings", "a jackknife over fewer has no meaning", "Efron and Stein 1981")
    min_energy_ratio: float = threshold(
        0.5,
        "share",
        "of the effect's energy in the recording that gains most; a recording with more must confirm the effect",
        FITS,
    )
    min_confirming_recordings: int = threshold(2, "recordings", "nuisances may absorb the gain of one", FITS)
    max_masked_energy: float = threshold(
        0.01, "share of the largest energy", "an effect with less does not show in a recording: a tenth in amplitude",
        PAIRS,
    )  # fmt: skip
    min_held_out_share: float = threshold(
        0.5, "share of the evidence", "if held-out conditions show less, most of it is the prior penalty of nuisances",
        FITS,
    )  # fmt: skip
    min_hammer_positions: int = threshold(3, "positions", "of fewer none can be called the exception", FITS)
    min_confirmation: float = threshold(
        0.5, "thresholds", "impacts at one position gain more, and all other conditions together less", FITS
    )

    # Reserved recordings
    max_reserved_excess: float = threshold(
        2.0, "control levels", "a larger residual contradicts the answer none; opened controls reach 0.37 to 0.54",
        GUIDE,
    )  # fmt: skip
    max_fit_loss: float = threshold(
        3.0, "points of fit", "a second name that costs more is rejected; no right pair of a sealed set lost over 1.1",
        PAIRS,
    )  # fmt: skip
    loss_errors: float = threshold(
        2.0,
        "standard errors",
        "a loss of fit within these carries no information; one in six wrong names reaches one",
        GUIDE,
    )
    max_reserved_steps: int = threshold(8, "steps", "of the nuisances that a reserved recording owns", "numerical")
    min_cost_decrease: float = threshold(
        1.0, "of minus twice the log posterior", "a step of these nuisances that gains less is the last", "numerical"
    )
    n_step_trials: int = threshold(3, "trials", "the step, its half and its quarter", "numerical")
    n_blocks: int = threshold(25, "stretches", "of a recording, over which the scatter is estimated", "convention")

    # Two effects
    max_rivals: int = threshold(2, "rivals", "are refitted beside a second effect", PAIRS)
    min_kept_gain_share: float = threshold(
        0.5, "share of the gain", "a rival that keeps more on top of the leader explains something else", PAIRS
    )
    shape_error_share: float = threshold(
        0.05, "share of the evidence", "an error in the shape of the first effect may leave it: sizes err by a fifth",
        PARTS,
    )  # fmt: skip

    # Shortlist
    same_site_distance: float = threshold(
        0.95, "m", "one and a half sleeper bays: effects of two families that are closer count as one", PAIRS
    )
    same_effect_distance: float = threshold(
        1.5, "m", "two sleeper bays: a second effect of the same family that is closer is an error in shape", PAIRS
    )
    hammer_promise_share: float = threshold(
        0.5,
        "share of the promise",
        "of a second effect that only hammer tests promise: others add to it",
        PAIRS,
    )
    min_promise_share: float = threshold(
        0.1,
        "share of the leader's gain",
        "from the third candidate on, those that promise less are not fitted",
        PARTS,
    )
    n_always_refitted: int = threshold(2, "candidates", "are refitted in any case", PARTS)
    n_families_with_sites: int = threshold(3, "families", "of which the second best sites are refitted", PRESCREEN)
    uninformed_sd_share: float = threshold(
        0.999, "share of the prior standard deviation", "if more remains, the data say nothing", ALWAYS
    )
    masking_sd: float = threshold(
        0.7, "-", "prior standard deviation of a masking parameter, a logarithm, if the effect is there", ALWAYS
    )
    min_start_multiple: float = threshold(0.1, "of a start", "a smaller size is no start", "numerical")
    max_start_multiple: float = threshold(3.0, "of a start", "a column is linear no further", ALWAYS)

    held_share: float = threshold(
        0.1, "of the prior standard deviation", "that a masking parameter keeps beside the effect that it hides",
        "numerical",
    )  # fmt: skip

    # Prescreening by hammer tests
    n_trial_steps: int = threshold(4, "steps", "of a trial fit", PRESCREEN)
    max_trial_starts: int = threshold(5, "starts", "of an effect of the whole track that are tried", PAIRS)
    min_hammer_step_gain: float = threshold(0.5, "nats", "a step that gains less ends a fit", PRESCREEN)

    # Refits
    max_rounds: int = threshold(
        3, "rounds", "of steps for a leader; one that still gains afterwards is far from any optimum", FITS
    )
    size_factors: tuple[float, ...] = threshold(
        (1.0, 0.75, 0.5), "shares", "of a leader's first two parameters: its response is nonlinear in both", FITS
    )
    min_held_share: float = threshold(
        0.5, "share of the gain", "from hammer tests; a refit that gains less has not converged", FITS
    )
    min_component_gain: float = threshold(
        0.5, "thresholds", "that an effect of a component must gain before its other effects are refitted", PARTS
    )
    min_leader_gain: float = threshold(0.5, "thresholds", "from which a leader is fitted to convergence", FITS)
    far_start_gain: float = threshold(
        4.0, "thresholds", "promised by hammer tests; beyond, a start needs derivatives of its own", FITS
    )
    max_halvings: int = threshold(
        4, "halvings", "of a start that costs more than no effect; a sixteenth of it is linear", FITS
    )

    # Joint fit
    n_steps: int = threshold(6, "steps", "of a joint fit, unless its caller sets more", "numerical")
    max_hammer_steps: int = threshold(
        60, "steps", "of a fit to hammer tests or of a small case: some minima are long and narrow", FITS
    )
    min_gain: float = threshold(0.05, "nats", "a smaller gain ends the iteration", "numerical")
    least_gain: float = threshold(
        1e-4, "nats", "the same where fits are compared whose residual is below the tolerated error", "numerical"
    )
    max_free_law_share: float = threshold(
        0.05, "share of the gain", "on held-out recordings, that a name may miss beside a free law", GUIDE
    )
    max_large_values: int = threshold(2, "values", "far beyond their priors in a fit without effects", "convention")
    n_large_starts: int = threshold(
        4, "fits", "of single large values, those with the most evidence in the linear model", "numerical"
    )
    large_start_sds: tuple[float, ...] = threshold(
        (1.5, 3.0), "wide prior sds", "at which a large value starts, with all others where fits start", "numerical"
    )
    min_large_information: float = threshold(
        1e-6, "1 / prior variance", "of a value in the data, below which its large values are not sought", "numerical"
    )
    stall: float = threshold(
        5e-4, "of minus twice the log posterior per sample", "a fit of a large case that gains less ends", FITS
    )
    fine_stall: float = threshold(
        1e-4, "of minus twice the log posterior per sample", "the same for fits on which the verdict rests", FITS
    )
    n_refresh_steps: int = threshold(4, "steps", "after which the Jacobian of a large case is recomputed", FITS)
    max_term_step: float = threshold(
        0.35, "share of the bounds", "largest step of a parameter of an effect", "numerical"
    )
    default_prior_sd: float = threshold(
        0.6, "share of the bounds", "prior standard deviation of a parameter without a prior of its own", FITS
    )
    derivative_step: float = threshold(
        0.02, "-", "step of a difference quotient, as a share of the smallest of three scales", "numerical"
    )
    derivative_sds: float = threshold(10.0, "prior standard deviations", "the second of these scales", "numerical")
    min_derivative_size: float = threshold(
        0.1, "largest steps", "the least distance from neutral, the third of these scales", "numerical"
    )
    promise_factor: float = threshold(
        5.0, "promises", "that further steps may gain: a fit ends if that is less than what is sought", FITS
    )
    max_dense_size: int = threshold(
        128, "samples", "of an observation whose errors are whitened by one dense matrix: a receptance", "numerical"
    )
    n_columns_together: int = threshold(
        64, "columns", "of starts that are projected together: more need memory and save no time", "numerical"
    )
    nuisance_step: float = threshold(
        0.1, "prior standard deviations", "step of a difference quotient by a nuisance", "numerical"
    )
    min_mode_energy: float = threshold(1e-4, "-", "a random error of less energy over sigma is left out", "numerical")

    # Damped steps
    max_damping_tries: int = threshold(8, "trials", "of one step, each with more damping than the last", "numerical")
    damping_increase: float = threshold(6.0, "-", "factor on the damping after a failed step", "Marquardt 1963")
    damping_decrease: float = threshold(0.2, "-", "factor on the damping after an accepted step", "Marquardt 1963")
    min_kept_promise: float = threshold(
        0.25, "share of the promise", "of a step of a small case; after one that gains less the next is smaller",
        "Marquardt 1963",
    )  # fmt: skip
    hold_damping: float = threshold(1e12, "times the diagonal", "the parameter does not move", "numerical")
    first_damping: float = threshold(1e-2, "times the diagonal", "the first damping", "Marquardt 1963")
    min_damping: float = threshold(1e-4, "times the diagonal", "a smaller damping is set to 0", "numerical")
    min_decrease_share: float = threshold(
        0.1, "share of the least decrease", "for which the fit goes on; steps that predict less are not tried",
        "numerical",
    )  # fmt: skip
    n_scale_iterations: int = threshold(5, "iterations", "of the noise scale after an undamped step", "numerical")
    n_reach_iterations: int = threshold(12, "iterations", "of the damping of parameters at their reach", "numerical")
    max_overreach: float = threshold(0.05, "share of the reach", "by which a step may exceed it", "numerical")

    # Localization and attribution of a residual
    min_amplitude: float = threshold(0.03, "-", "variance of a random effect over that of noise, smallest", LOCATED)
    max_amplitude: float = threshold(3e4, "-", "the same, largest", LOCATED)
    n_amplitudes: int = threshold(21, "-", "values between them", "numerical")
    max_noise_factor: float = threshold(100.0, "-", "noise over that of intact recordings, largest", LOCATED)
    n_noise_factors: int = threshold(25, "-", "values up to it", "numerical")
    min_hammer_evidence: float = threshold(
        6.0, "nats", "that impacts must add before a fault of a channel is named: it shows in impacts, too", LOCATED
    )
    max_changed_positions: int = threshold(
        3, "positions", "whose components change together under trains, at most: a cause of some length", LOCATED
    )
    position_margin: float = threshold(
        6.0,
        "nats",
        "closer positions are not distinguished: odds of 400 to 1, less errors of the model",
        LOCATED,
    )
    min_explained_share: float = threshold(
        0.25, "share of the excess", "from which a rejected candidate counts as evidence for its site", LOCATED
    )
    min_cells: int = threshold(8, "cells", "a frame with fewer is not tested", LOCATED)
    min_levels: int = threshold(3, "levels", "of two none can be called the exception", "Grubbs 1950")
    min_cell_share: float = threshold(
        0.5, "share of the median number of cells", "the mean of a level with fewer scatters too much", LOCATED
    )
    n_sweeps: int = threshold(2, "sweeps", "that subtract the level means of other frames", "numerical")

    # Free law of a latent force
    max_pieces: int = threshold(24, "pieces", "of the free law", "numerical")
    min_samples_per_piece: int = threshold(20, "samples", "of a piece of the free law", "convention")
    n_held_out_blocks: int = threshold(10, "blocks", "of time, of which each is held out in turn", "convention")

    # Distinguishability of effects in a planned campaign
    linear_share: float = threshold(
        0.02, "share of a size", "at which an effect is linear; effects with a threshold are taken at full size",
        "numerical",
    )  # fmt: skip
    min_evidence: float = threshold(5.0, "nats", "odds of 150 to 1: two effects are distinguished", GUIDE)
    max_useful_evidence: float = threshold(50.0, "nats", "more makes no decision surer", "convention")


THRESHOLDS = Thresholds()


def threshold_rows() -> list[tuple[str, Any, str, str, str]]:
    """(name, value, unit, reason, source) of every threshold, in the order of the code."""
    return [
        (f.name, f.default, f.metadata["unit"], f.metadata["reason"], f.metadata["source"]) for f in fields(Thresholds)
    ]
