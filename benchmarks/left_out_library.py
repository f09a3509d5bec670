"""Every effect of the library with its kinds in the blind generator and its relatives, for the tests in an open world.

Nothing is listed twice: kinds are those whose right name the effect is, and relatives are laws of the same component or
forms of one another, as the effects declare it. Faults of channels that the generator lacks are files of the folder
``left_out_effects``. A new effect without a kind needs a line in ``WITHOUT_KIND``.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from turnout import physics
from turnout_blind.effect import load_effects
from turnout_blind.score.names import RIGHT_NAMES

OWN_KINDS = Path(__file__).with_name("left_out_effects")  # named as the effect of the library that they conceal
OWN_NAMES = {path.stem: (path.stem,) for path in sorted(OWN_KINDS.glob("*.py"))}

# Effects of one part without a ``component``: the tread of a wheel, the running surface of the rail, and an amplifier
SAME_PART = (
    frozenset({"wheel_flat", "out_of_round"}),
    frozenset({"surface_dip", "rail_corrugation"}),
    frozenset({"sensor_gain", "passage_gain", "hammer_gain"}),
)
# Effect -> why the generator has no case of it
WITHOUT_KIND = {
    "dry_friction": "its supports have no slider",
    "pad_preload": "its pads do not stiffen under load",
    "ballast_inertia": "no ballast moves with its sleepers",
    "sleeper_mode": "its sleepers are rigid",
    "contact_stiffness": "its contact follows the radii of wheel and rail",
}


@dataclass(frozen=True)
class LibraryEffect:
    """``kinds`` of the generator that conceal an effect, and ``relatives`` whose names may be given in its place."""

    kinds: tuple[str, ...]
    relatives: tuple[str, ...]


@cache
def kinds_of_effects():
    """Kinds of the generator, with those of ``left_out_effects``.

    Returns
    -------
    dict
        ``turnout_blind.effect.Effect`` by kind.
    """
    return load_effects(OWN_KINDS)


@cache
def library():
    """Every effect that a diagnosis tests.

    Returns
    -------
    dict
        ``LibraryEffect`` by name, in the order of ``physics.TERMS``.
    """
    tested = [effect for effect in physics.TERMS if effect.asked]
    strata = {kind: effect.stratum for kind, effect in kinds_of_effects().items()}
    kinds = {effect.name: [] for effect in tested}
    for kind, names in (RIGHT_NAMES | OWN_NAMES).items():
        for name in names if strata[kind] != "unidentifiable" else ():
            kinds[name].append(kind)
    return {
        effect.name: LibraryEffect(
            tuple(kinds[effect.name]), tuple(e.name for e in tested if e is not effect and are_relatives(effect, e))
        )
        for effect in tested
    }


def are_relatives(effect, other):
    """Whether two effects are laws of one component, forms of one another, or effects of one part.

    Parameters
    ----------
    effect, other : type
        Classes of effects.

    Returns
    -------
    bool
        The same in either order.
    """
    pair = {effect.name, other.name}
    forms = {name for e in (effect, other) for name in (e.limit_form, e.unbounded_form, *e.simpler_form[:1]) if name}
    same_component = bool(effect.component) and effect.component == other.component
    return same_component or bool(forms & pair) or any(pair <= part for part in SAME_PART)
