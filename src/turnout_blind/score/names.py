"""What the tool may call each concealed effect: the only place where the two vocabularies meet."""

# Kind -> names that are right. None of the tool's names is right for a kind outside its library, except where a
# library has grown to hold it.
RIGHT = {
    "void": ("hanging_sleeper",),
    "ballast": ("local_ballast",),
    "pad": ("local_pad",),
    "pad_temperature": ("pad_temperature",),
    "pad_fractional": ("zener_pad",),
    "rail_shear": ("rail_shear",),
    "dip": ("surface_dip",),
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
    "bilinear_clip": (),
    "drifting_support": (),
    "neighbouring_train": (),
    "one_temperature": ("pad_temperature",),
    "beyond_reach": ("local_pad",),
    "bottomless_void": ("hanging_sleeper",),
    "common_gain": ("sensor_gain",),
}

# Kind -> what it may be said to be locked to. A lag is the sensor's or its clock's; what acts with amplitude at one
# place is locked to either. A polygon goes with its wheel, too heavy wheelsets with their train, and with nothing else.
LOCKS = {
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

# Kind -> {parameter: the tool's parameter of the same meaning}. A flat's length is in both that of the chord with a
# depth of l^2 / 16 R, however far its edges are worn; a limit is the mean of both sides. Not compared: a power law has
# no single branch, a polygon's cosine and sine hang on where the angle is counted from, a mount yields beside another.
SAME = {
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
}


def right_names(kind, more=None):
    """Names that are right for ``kind``; ``more`` {kind: [names]} for effects of one's own."""
    return tuple(RIGHT.get(kind, ())) + tuple((more or {}).get(kind, ()))


def same_parameters(effect):
    """{parameter: the tool's of the same meaning} of one concealed effect (its entry in the truth).

    A sleeper that still bears on a part of its bed has no gap of its own: only one that hangs whole has.
    """
    if effect["parameters"].get("seated", 0.0) > 0.0:
        return {}
    return SAME.get(effect["kind"], {})


def right_locks(kind, locked_to):
    """What ``kind`` may be said to be locked to."""
    return LOCKS.get(kind, (locked_to,))
