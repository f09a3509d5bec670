"""Modes of single blows, and the campaign value with interval that they add up to."""

from dataclasses import dataclass, field

import numpy as np

from turnout.identify.summary import summarise
from turnout.records import Mode

NEXT_TO_NOTHING = 1e-12


@dataclass(frozen=True)
class ImpactEstimates:
    """One mode in several blows: ``impact`` (n,) numbers, ``estimate`` and ``error`` (n, 2) of ln f [Hz] and zeta.

    An error of nan is one that nobody knows, and becomes None; all that blows differ by counts as their spread then.

    ``strength`` (n,) is the norm of each decay; ``bound`` (2,) the Cramér-Rao bound, None where unknown;
    ``choice`` (2,) the error of the choice among explanations, which all blows share.
    """

    band: str
    impact: np.ndarray
    estimate: np.ndarray
    error: np.ndarray
    strength: np.ndarray
    energy: float | None = None
    bound: np.ndarray | None = None
    choice: np.ndarray = field(default_factory=lambda: np.zeros(2))

    def rows(self) -> list[dict]:
        """The table ``per_impact`` of a modal model."""
        frequency = np.exp(self.estimate[:, 0])
        return [
            {
                "impact": int(self.impact[i]),
                "band": self.band,
                "frequency": float(frequency[i]),
                "damping": float(self.estimate[i, 1]),
                "frequency_se": _known(frequency[i] * self.error[i, 0]),
                "damping_se": _known(self.error[i, 1]),
            }
            for i in range(len(self.impact))
        ]

    def mode(self, confidence: float) -> Mode:
        """Random-effects mean over the blows; the frequency is summarised in its logarithm.

        Weights follow the strength of each blow. Its stated error would not do: a noisy blow's error follows its
        own estimate, and weighing by it would favour one side.
        """
        error = np.median(self.error * self.strength[:, None], axis=0) / self.strength[:, None]
        error = np.nan_to_num(error, nan=NEXT_TO_NOTHING) if len(error) > 1 else error
        log_f = summarise(self.estimate[:, 0], error[:, 0], confidence, self.choice[0])
        zeta = summarise(self.estimate[:, 1], error[:, 1], confidence, self.choice[1])
        f = float(np.exp(log_f.mean))
        return Mode(
            band=self.band,
            frequency=f,
            damping=zeta.mean,
            frequency_se=_known(f * log_f.se),
            damping_se=_known(zeta.se),
            frequency_sd=f * log_f.spread,
            damping_sd=zeta.spread,
            frequency_low=_known(np.exp(log_f.low)),
            frequency_high=_known(np.exp(log_f.high)),
            damping_low=_known(zeta.low),
            damping_high=_known(zeta.high),
            frequency_crb=None if self.bound is None else f * float(self.bound[0]),
            damping_crb=None if self.bound is None else float(self.bound[1]),
            energy=self.energy,
            n=log_f.n,
        )


def _known(value) -> float | None:
    return None if np.isnan(value) else float(value)
