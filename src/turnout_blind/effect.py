"""Definition of an effect that can be concealed: a file in ``effects/``, or in a folder given to `--effects`.

The file defines ``EFFECT``, an ``Effect``. No other file needs a change: the plan gives it cases and the seal hides
them. The scorer counts every name for it as wrong, unless ``score/names.py`` or ``--names`` lists right ones.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np

LOCKS = ("place", "wheel", "train", "sensor", "wavelength", "frequency", "clock", "condition", "amplitude")
STRATA = ("single", "outside", "unidentifiable")


@dataclass(frozen=True)
class ConcealedEffect:
    """One concealed effect in SI units: where it is and its ``parameters``.

    ``where`` holds those of "position", "sleeper", "sensor", "train" and "axle" that apply.
    """

    kind: str
    locked_to: str
    where: Mapping = field(default_factory=dict)
    parameters: Mapping = field(default_factory=dict)
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
    ladder: tuple
    draw: Callable
    act: Callable
    stratum: str = "single"
    site: Mapping = field(default_factory=dict)

    def __post_init__(self):
        if self.locked_to not in LOCKS or self.stratum not in STRATA:
            raise ValueError(f"effect {self.kind!r}: locked to {self.locked_to!r} or stratum {self.stratum!r} unknown")

    def draw_concealed(self, rng, site, rung):
        """A ``ConcealedEffect`` at ``rung`` of the ladder, counted from 0."""
        where, parameters = self.draw(rng, site, self.ladder[rung])
        return ConcealedEffect(self.kind, self.locked_to, where, parameters, rung)


def load_effects(*folders):
    """Effects by kind from this package and from ``folders``. ValueError names a file without an effect.

    >>> from turnout_blind.effect import load_effects
    >>> sorted(load_effects())[:3]
    ['ballast', 'bilinear_clip', 'bottomless_void']
    """
    effects = {}
    for folder in (Path(__file__).with_name("effects"), *map(Path, folders)):
        for path in sorted(folder.glob("*.py")):
            if path.name.startswith("_"):
                continue
            spec = spec_from_file_location(f"turnout_blind_effect_{path.stem}", path)
            module = module_from_spec(spec)
            spec.loader.exec_module(module)
            effect = getattr(module, "EFFECT", None)
            if not isinstance(effect, Effect):
                raise ValueError(f"{path}: defines no EFFECT of class turnout_blind.effect.Effect")
            effects[effect.kind] = effect
    return effects


def draw_sign(rng):
    """+1 or -1 with equal probability."""
    return 1.0 if rng.random() < 0.5 else -1.0


def draw_sleeper(rng, site):
    """{"sleeper": index, "position": [m]} of a sleeper between the sensors, drawn uniformly."""
    low, high = min(site.sensors) - 0.35, max(site.sensors) + 0.35
    inside = np.flatnonzero((site.world.position > low) & (site.world.position < high))
    j = int(rng.choice(inside))
    return {"sleeper": j, "position": float(site.world.position[j])}


def draw_sensor(rng, site):
    """{"sensor": name}, drawn uniformly."""
    return {"sensor": str(rng.choice(site.names()))}


def draw_axle(rng, site):
    """{"train", "axle"}, the train drawn uniformly and then one of its axles, counted from 1."""
    train = str(rng.choice(sorted(site.trains)))
    return {"train": train, "axle": int(rng.integers(1, site.trains[train].axles().size + 1))}
