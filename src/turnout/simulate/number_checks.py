"""Check numbers that a user gives to a simulation, with errors that name the number."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from datetime import datetime
from math import inf, isfinite
from operator import index
from typing import Any

from turnout.errors import SimulationError


def check_number(
    title: str, value: Any, unit: str = "", above: float = -inf, least: float = -inf, below: float = inf
) -> None:
    """Reject what is not a finite number within limits.

    Parameters
    ----------
    title : str
        What the number is of, the first word of the error.
    value : Any
        The number; of text, even of digits, it is an error.
    unit : str
        Unit of the number.
    above : float
        The number is larger than this.
    least : float
        The number is at least this.
    below : float
        The number is smaller than this.

    Raises
    ------
    SimulationError
        With the limits and what was given.

    Examples
    --------
    >>> check_number("hammer: mass", -5.0, "kg", above=0.0)
    Traceback (most recent call last):
    turnout.errors.SimulationError: hammer: mass must be above 0 kg, got -5.0.
    """
    try:
        number = float("nan" if isinstance(value, str) else value)
    except (TypeError, ValueError):
        number = float("nan")
    if isfinite(number) and number > above and least <= number < below:
        return
    bounds = (("above", above), ("at least", least), ("below", below))
    limits = " and ".join(f"{word} {limit:g}" for word, limit in bounds if isfinite(limit))
    demand = f"{limits} {unit}".rstrip() if limits else f"a finite number{f' in {unit}' if unit else ''}"
    raise SimulationError(f"{title} must be {demand}, got {value!r}.")


def check_fields(title: str, record: Any) -> None:
    """Reject a record with a field of type float that is not a finite number: an infinite length would be no defect.

    Parameters
    ----------
    title : str
        What the record is, the first words of the error.
    record : dataclass
        The record.

    Raises
    ------
    SimulationError
        With the field and what was given.
    """
    for field in fields(record):
        if field.type in (float, "float"):
            check_number(f"{title}: {field.name}", getattr(record, field.name))


def check_count(title: str, value: Any, least: int = 1) -> None:
    """Reject what is not a whole number of at least ``least``.

    Parameters
    ----------
    title : str
        What is counted, the first word of the error.
    value : Any
        The count.
    least : int
        Smallest count.

    Raises
    ------
    SimulationError
        With what was given.

    Examples
    --------
    >>> check_count("substeps", 1.5)
    Traceback (most recent call last):
    turnout.errors.SimulationError: substeps must be a whole number of at least 1, got 1.5.
    """
    try:
        is_enough = index(value) >= least
    except TypeError:
        is_enough = False
    if not is_enough:
        raise SimulationError(f"{title} must be a whole number of at least {least}, got {value!r}.")


def check_seed(title: str, value: Any) -> None:
    """Reject what seeds no random numbers: a whole number from 0, or a sequence of them, does.

    Parameters
    ----------
    title : str
        What the seed is of, the first word of the error.
    value : Any
        The seed.

    Raises
    ------
    SimulationError
        With what was given.
    """
    for number in value if isinstance(value, Iterable) else (value,):
        check_count(title, number, least=0)


def check_start_time(moment: Any) -> None:
    """Reject a start time that is not in UTC without a zone, as all times are.

    Parameters
    ----------
    moment : Any
        The time, or None.

    Raises
    ------
    SimulationError
        With what was given.
    """
    if moment is not None and not (isinstance(moment, datetime) and moment.tzinfo is None):
        raise SimulationError(f"started_at must be a datetime in UTC without a time zone, or None, got {moment!r}.")
