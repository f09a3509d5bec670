"""Right names of each concealed effect: the only module in which the vocabularies of generator and tool meet."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

# Kind -> right names. A kind outside the library of the tool has none, unless the library has since been extended.
RIGHT_NAMES = {
    "void": ("hanging_sleeper",),
    "ballast": ("local_ballast",),
    "pad": ("local_pad",),
    "pad_temperature": ("pad_temperature",),
    "pad_fractional": ("zener_pad",),
    "rail_shear": ("rail_shear",),
    "dip": ("surface_dip",),
    "nose": ("surface_dip",),
    "flat": ("wheel_flat",),
    "out_of_round": ("out_of_round",),
    "corrugation": ("rail_corrugation",),
    "unsprung_mass": ("unsprung_mass",),
    "hardening": ("ballast_hardening",),
    "gain": ("sensor_gain",),
    "time_offset": ("time_offset",),
    "mount_resonance": ("mount_resonance",),
    "position": ("sensor_position",),
    "clipping": ("clipping",),
    "local_resonator": ("attached_resonator",),
    "guard_rail_rattle": (),
    "bilinear_clip": ("loose_fastening",),
    "drifting_support": (),
    "neighbouring_train": (),
    "one_temperature": ("pad_temperature",),
    "beyond_reach": ("local_pad",),
    "bottomless_void": ("hanging_sleeper",),
    "common_gain": ("sensor_gain",),
    "chair_gap": ("slide_chair_gap",),
    "heel": ("heel_support",),
    "toe": ("worn_toe",),
}

# Kind -> right locks. A delay belongs to the sensor or its clock. An effect of amplitude at one position is locked to
# either. A polygon is locked to its wheel only, too heavy wheelsets to their train only.
RIGHT_LOCKS = {
    "pad_fractional": ("condition", "frequency"),
    "rail_shear": ("condition", "frequency"),
    "corrugation": ("wavelength", "place"),
    "hardening": ("amplitude", "place", "condition"),
    "time_offset": ("sensor", "clock"),
    "clipping": ("sensor", "amplitude"),
    "local_resonator": ("place", "frequency"),
    "guard_rail_rattle": ("place", "amplitude", "frequency"),
    "bilinear_clip": ("place", "amplitude"),
    "drifting_support": ("place", "condition"),
    "neighbouring_train": ("clock", "condition", "train"),
    "common_gain": ("condition", "sensor", "train"),
}

# Kind -> {parameter: parameter of the tool with the same meaning}. The length of a flat is in both the chord with a
# depth of l^2 / 16 R, however worn its edges are. A limit is the mean of both sides. Not compared: a power law has no
# single branch, cosine and sine of a polygon depend on the origin of the angle, a mount is in series with another.
SAME_PARAMETERS = {
    "void": {"gap": "gap"},
    "ballast": {"factor": "factor"},
    "pad": {"factor": "factor"},
    "pad_temperature": {"coefficient": "coefficient"},
    "dip": {"depth": "depth"},
    "flat": {"length": "length"},
    "unsprung_mass": {"factor": "factor"},
    "gain": {"gain": "gain"},
    "time_offset": {"delay": "delay"},
    "position": {"shift": "shift"},
    "clipping": {"limit": "limit"},
    "corrugation": {"wavelength": "wavelength"},
    "chair_gap": {"gap": "gap"},
    "heel": {"factor": "factor"},
    "toe": {"depth": "depth"},
}


def right_names(effect_type: str, extra_names: Mapping[str, Sequence[str]] | None = None) -> tuple[str, ...]:
    """Right names of an effect type.

    Parameters
    ----------
    effect_type : str
        Kind of the effect.
    extra_names : mapping or None
        Right names of added effects by kind.

    Returns
    -------
    tuple of str
        Names, none for an effect outside the library.
    """
    return tuple(RIGHT_NAMES.get(effect_type, ())) + tuple((extra_names or {}).get(effect_type, ()))


def same_parameters(effect: Mapping[str, Any]) -> dict[str, str]:
    """Parameters of a concealed effect that have the same meaning in the tool.

    A sleeper that is partly supported has no comparable gap: only one that hangs completely has.

    Parameters
    ----------
    effect : mapping
        Entry of the effect in the truth.

    Returns
    -------
    dict
        Parameter of the tool by parameter of the effect.
    """
    if effect["parameters"].get("seated", 0.0) > 0.0:
        return {}
    return SAME_PARAMETERS.get(effect["kind"], {})


def right_locks(effect_type: str, locked_to: str) -> tuple[str, ...]:
    """Right locks of an effect type.

    Parameters
    ----------
    effect_type : str
        Kind of the effect.
    locked_to : str
        What the effect is locked to, the only right lock if none is listed.

    Returns
    -------
    tuple of str
        Locks.
    """
    return RIGHT_LOCKS.get(effect_type, (locked_to,))
