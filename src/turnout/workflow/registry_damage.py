"""Damage of the registry as a parameter of the job that repairs it.

Snakemake runs a job again when a parameter differs from that of its last run. So the parameter has to change when
damage appears, and must not change when it is repaired: the job leaves the value with which it ran.
"""

from os import PathLike
from pathlib import Path

from turnout.files import write_text
from turnout.registry.damage import damage_stamp

LAST_REPAIR = Path("work/last_repair")


def repair_request(registry_dir: str | PathLike) -> str:
    """Parameter of the registration: a new value if the registry is damaged, else that of the last repair.

    Parameters
    ----------
    registry_dir : path-like
        Folder of the registry.

    Returns
    -------
    str
        Number of the repair and what is damaged; "" if nothing was ever damaged.
    """
    last = LAST_REPAIR.read_text(encoding="utf-8") if LAST_REPAIR.exists() else ""
    damage = damage_stamp(registry_dir)
    if not damage:
        return last
    number = last.partition(" ")[0]
    return f"{int(number) + 1 if number.isdecimal() else 1} {damage}"


def note_repair(request: str) -> None:
    """Keep the request that a registration has fulfilled.

    Parameters
    ----------
    request : str
        The parameter with which the registration ran; "" if nothing was damaged.
    """
    if request:
        write_text(LAST_REPAIR, request)
