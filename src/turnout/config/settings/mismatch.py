"""Settings of the diagnosis of mismatches."""

from dataclasses import dataclass

from turnout.config.settings.setting import setting


@dataclass(frozen=True)
class MismatchSettings:
    """Settings of ``turnout.mismatch``: when a difference counts, and when it may carry a name."""

    enabled: bool = setting(False, why="diagnose in the nightly run; it takes minutes per turnout")
    unproven_names: bool = setting(False, why="give names at panels whose diagnoses are not proven on concealed data")
    materiality: float = setting(
        0.06, "-", "share of the local amplitude below which a difference causes no action", 0.0, 0.5
    )
    pair_tolerance: float = setting(0.03, "-", "tolerated relative error of gain and slope of a receptance", 0.0, 0.5)
    control_level: float = setting(
        1.6, "-", "weighted mean square above which a fit has not reached the control level", 1.0, 100.0
    )
    hammer_control: float = setting(
        0.9, "-", "weighted mean square of receptances that controls of another generator stay below", 0.1, 100.0
    )
    passage_control: float = setting(
        0.7, "-", "weighted mean square of passages that controls of another generator stay below", 0.1, 100.0
    )
    cell_control: float = setting(
        2.0, "-", "the same of one channel of one passage: the largest of 55 controls was 1.9, others 1.2", 0.1, 100.0
    )
    place_control: float = setting(
        80.0,
        "nats",
        "evidence for a position that the residuals of intact turnouts reach: the largest of 46 controls was 78",
        0.0,
    )
    threshold: float = setting(
        12.0,
        "nats",
        "evidence that a name needs at least, odds of 160,000 to 1; 8 of 360 sealed controls had more",
        0.0,
    )
    margin: float = setting(6.0, "nats", "runner-up within this of the best: 'a or b'", 0.0)
    explained: float = setting(0.5, "-", "share of the excess that a name must explain", 0.0, 1.0)
    leftover: float = setting(
        4.0, "-", "mean square left over the control level above which even the best name is rejected", 1.0
    )
    withdrawn_ratio: float = setting(
        2.0, "-", "mean square on reserved over calibration recordings that withdraws a name", 1.0
    )
    fall: float = setting(
        1.0,
        "%",
        "loss of fit on reserved recordings that withdraws a name, if beyond two standard errors",
        0.0,
        100.0,
    )
    structure_left: float = setting(
        0.4, "-", "share of the residual that a free law still explains: the shape is not resolved", 0.0, 1.0
    )
    temperature: float = setting(4.0, "-", "divisor of scores before they become probabilities; chosen by hand", 0.1)
    softmax_share: float = setting(0.2, "-", "weight of the scores in the probability of an answer", 0.0, 1.0)
    certainty_none: float = setting(0.88, "-", "share of 'none' that is right, from 60 of 67 opened cases", 0.01, 0.99)
    certainty_named: float = setting(
        0.93, "-", "share of names that are right, judged from few opened cases", 0.01, 0.99
    )
    certainty_unknown: float = setting(
        0.55, "-", "share of 'unknown' where the catalogue has no name, judged from few opened cases", 0.01, 0.99
    )
    certainty_clock: float = setting(
        0.83, "-", "the same for vibration without a wheel near: two of two, with Jeffreys' prior", 0.01, 0.99
    )
    unknown_offset: float = setting(
        -12.0, "nats", "score of 'unknown' relative to what the best candidate leaves; chosen by hand"
    )
    base_iterations: int = setting(15, why="Gauss-Newton steps of the base fit", minimum=1, maximum=100)
    scouted_places: int = setting(2, why="positions of an effect fitted to hammer tests alone", minimum=1, maximum=50)
    promise: float = setting(2.0, "nats", "estimated gain below which a candidate is not refitted", 0.0)
    joint_starts: int = setting(1, why="positions of the first effects that are refitted", minimum=1, maximum=20)
    refits: int = setting(5, why="effects refitted jointly where passages are simulated", minimum=2, maximum=50)
    iterations: int = setting(6, why="Gauss-Newton steps of a joint refit", minimum=1, maximum=50)
    effects: int = setting(2, why="effects sought one after the other", minimum=1, maximum=3)
    numerics_share: float = setting(
        0.333, "-", "numerical error over mismatch above which no cause is named", 0.01, 1.0
    )

    def certainty(self, answer: str, disturbed: bool = False) -> float:
        """Share of answers like this one that were right in opened cases.

        Parameters
        ----------
        answer : str
            Answer of a diagnosis: "none", "unknown", or any other for a named effect.
        disturbed : bool
            Whether sensors shook while no wheel was near.

        Returns
        -------
        float
            Probability that the answer is right.
        """
        if answer == "unknown" and disturbed:
            return self.certainty_clock
        return {"none": self.certainty_none, "unknown": self.certainty_unknown}.get(answer, self.certainty_named)
