"""Definition of an effect that can be concealed: a file in ``effects/``, or in a folder given to `--effects`.

The file defines ``EFFECT``, an ``Effect``. No other file needs a change: the plan gives it cases and the seal hides
them. The scorer counts every name for it as wrong, unless ``score/names.py`` or ``--names`` lists right ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from typing import Any

    from turnout_blind.site import Site
    from turnout_blind.true_site import World

LOCKS = ("place", "wheel", "train", "sensor", "wavelength", "frequency", "clock", "condition", "amplitude")
# "history": in histories, and in single campaigns in the panel that it needs; "switch": in switch panels alone
STRATA = ("single", "outside", "unidentifiable", "history", "switch")


@dataclass(frozen=True)
class ConcealedEffect:
    """One concealed effect in SI units: where it is and its ``parameters``.

    ``where`` holds those of "position", "sleeper", "sensor", "train" and "axle" that apply.
    """

    kind: str
    locked_to: str
    where: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, Any] = field(default_factory=dict)
    rung: int = 0


@dataclass(frozen=True)
class Effect:
    """A type of effect: ``draw(rng, site, severity)`` -> (where, parameters), ``act(world, site, where, parameters)``.

    ``act`` changes the world. ``ladder`` holds severities from hidden to obvious, one per rung. ``site`` holds options
    of ``draw_site`` that the effect needs, such as one temperature. ``stratum`` is one of ``STRATA``, ``locked_to`` one
    of ``LOCKS``.
    """

    kind: str
    locked_to: str
    ladder: tuple[Any, ...]
    draw: Callable
    act: Callable
    stratum: str = "single"
    site: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.locked_to not in LOCKS or self.stratum not in STRATA:
            raise ValueError(f"effect {self.kind!r}: locked to {self.locked_to!r} or stratum {self.stratum!r} unknown")

    def draw_concealed(self, rng: np.random.Generator, site: Site, rung: int) -> ConcealedEffect:
        """Draw one effect.

        Parameters
        ----------
        rng : Generator
            Source of the random numbers.
        site : Site
            The site.
        rung : int
            Rung of the ladder, counted from 0.

        Returns
        -------
        ConcealedEffect
            The effect with its position and parameters.
        """
        where, parameters = self.draw(rng, site, self.ladder[rung])
        return ConcealedEffect(self.kind, self.locked_to, where, parameters, rung)

    def in_recordings_of(self, recording_type: str, new_kind: str) -> Effect:
        """The same fault of a channel in recordings of one type alone.

        Parameters
        ----------
        recording_type : str
            "hammer" or "passage".
        new_kind : str
            Name of the new effect.

        Returns
        -------
        Effect
            It leaves recordings of the other type as they are.
        """

        def act(world: World, site: Site, where: Mapping[str, Any], p: Mapping[str, Any]) -> None:
            self.act(world, site, where, p)
            faults = world.channels[where["sensor"]]
            everywhere = faults.pop()
            faults.append(lambda of, rng: everywhere(of, rng) if of == recording_type else lambda x, rate: x)

        return replace(self, kind=new_kind, act=act)


def load_effects(*folders: str | Path) -> dict[str, Effect]:
    """Effects of this package and of further folders.

    Parameters
    ----------
    *folders : str or Path
        Folders with further effects, one per file.

    Returns
    -------
    dict
        Effect by kind.

    Raises
    ------
    ValueError
        For a file that defines no effect.

    Examples
    --------
    >>> from turnout_blind.effect import load_effects
    >>> sorted(load_effects())[:3]
    ['ballast', 'beyond_reach', 'bilinear_clip']
    """
    effects = {}
    for folder in (Path(__file__).with_name("effects"), *map(Path, folders)):
        for path in sorted(folder.glob("*.py")):
            if path.name.startswith("_"):
                continue
            spec = spec_from_file_location(f"turnout_blind_effect_{path.stem}", path)
            if spec is None or spec.loader is None:
                raise ValueError(f"{path}: cannot be imported")
            module = module_from_spec(spec)
            spec.loader.exec_module(module)
            effect = getattr(module, "EFFECT", None)
            if not isinstance(effect, Effect):
                raise ValueError(f"{path}: defines no EFFECT of class turnout_blind.effect.Effect")
            effects[effect.kind] = effect
    return effects


def draw_sign(rng: np.random.Generator) -> float:
    """+1 or -1 with equal probability.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.

    Returns
    -------
    float
        The sign.
    """
    return 1.0 if rng.random() < 0.5 else -1.0


def draw_sleeper(rng: np.random.Generator, site: Site) -> dict[str, Any]:
    """A sleeper between the sensors, drawn uniformly.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site.

    Returns
    -------
    dict
        {"sleeper": index, "position": [m]}.
    """
    low, high = min(site.sensors) - 0.35, max(site.sensors) + 0.35
    inside = np.flatnonzero((site.world.position > low) & (site.world.position < high))
    j = int(rng.choice(inside))
    return {"sleeper": j, "position": float(site.world.position[j])}


def draw_sensor(rng: np.random.Generator, site: Site) -> dict[str, Any]:
    """A sensor, drawn uniformly.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site.

    Returns
    -------
    dict
        {"sensor": name}.
    """
    return {"sensor": str(rng.choice(site.names()))}


def draw_axle(rng: np.random.Generator, site: Site) -> dict[str, Any]:
    """An axle: the train drawn uniformly and then one of its axles.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    site : Site
        The site.

    Returns
    -------
    dict
        {"train": name, "axle": number, counted from 1}.
    """
    train = str(rng.choice(sorted(site.trains)))
    return {"train": train, "axle": int(rng.integers(1, site.trains[train].axles().size + 1))}
