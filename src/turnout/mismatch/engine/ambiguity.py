"""Evidence for something that the recordings show and cannot tell what it is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Ambiguity:
    """Something with several explanations that the recordings cannot distinguish.

    Attributes
    ----------
    nats : float
        Evidence that it is there. [nats]
    words : str
        What is there, and what it may be.
    measurement : str
        The measurement that decides.
    frame : str
        What it may be fixed to.
    level : str
        At which value of that.
    low, high : float or None
        Where it shows [m]; None of a train or channel.
    """

    nats: float
    words: str
    measurement: str
    frame: str
    level: str
    low: float | None = None
    high: float | None = None
