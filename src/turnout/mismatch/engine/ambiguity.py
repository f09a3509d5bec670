"""Evidence for something that the recordings show and cannot tell what it is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Ambiguity:
    """Something between ``low`` and ``high`` [m] with several explanations that the recordings cannot distinguish.

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
    low, high : float
        Where it shows. [m]
    """

    nats: float
    words: str
    measurement: str
    frame: str
    level: str
    low: float
    high: float
