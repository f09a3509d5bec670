"""What recordings must have for an effect to be examined, and the measurement that supplies it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

Recorded: TypeAlias = Mapping[str, Sequence[Any]]  # quantity -> its value in each recording, None where it is not known


@dataclass(frozen=True)
class Requirement:
    """A property of the recordings without which an effect cannot be examined.

    Attributes
    ----------
    quantity : str
        What of the recordings counts: "passage", "hammer_test", "train", "speed" or "rail_temperature".
    measure : str
        "count" of different values, "range" from the lowest to the highest, or "ratio" of these.
    least : float
        Least value of the measure.
    lack : str
        What is missing otherwise, in words.
    measurement : str
        The measurement that supplies it.
    part : str
        The part of the effect that is concerned, in words; "": all of it.
    is_strict : bool
        Whether it is not tested otherwise. Else it is tested, and most of its sizes stay below the evidence of a name.
    """

    quantity: str
    measure: str
    least: float
    lack: str
    measurement: str
    part: str = ""
    is_strict: bool = True

    def is_met(self, recorded: Recorded) -> bool:
        """Whether recordings have it.

        Parameters
        ----------
        recorded : mapping
            Quantity -> its value in each recording that has this quantity.

        Returns
        -------
        bool

        Examples
        --------
        >>> speeds = Requirement("speed", "ratio", 1.25, "all passages have about one speed", "passages at another")
        >>> speeds.is_met({"speed": [20.0, 26.0]}), speeds.is_met({"speed": [20.0, 24.0]}), speeds.is_met({})
        (True, False, False)
        >>> speeds.is_met({"speed": [0.0, 20.0]})  # a train that stands has no ratio
        False
        """
        values = recorded.get(self.quantity, ())
        if self.measure == "count":
            return len({v for v in values if v is not None}) >= self.least
        if not values or None in values:
            return False
        low, high = min(values), max(values)
        return high - low >= self.least if self.measure == "range" else high >= self.least * low > 0


PASSAGES = Requirement("passage", "count", 1, "no passage was used", "passages of trains")
# Planned passages of one train at two speeds over four sensors have less evidence than a name needs.
IMPACTS = Requirement("hammer_test", "count", 1, "no hammer test was used", "hammer tests", is_strict=False)
