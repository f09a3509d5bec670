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
# place is locked to either.
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

# Kind -> {parameter: the tool's parameter of the same meaning}. Shapes that differ have none that could be compared:
# the length of a rounded flat is half again the tool's, a power law has no single branch.
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


def right_locks(kind, locked_to):
    """What ``kind`` may be said to be locked to."""
    return LOCKS.get(kind, (locked_to,))
