"""Effects that a simulation may have left out, one per file. A new one is a new file and a line in TERMS.

The file holds everything that is known of the effect: its equation, its parameters with their sources, where a
diagnosis tests it and what a finding says of it (``PhysicsTerm``). The contract tests ask every listed effect for each
of these. They also check that it vanishes at its neutral value and leaves a resting track alone.
"""

from turnout.physics.attached_resonator import AttachedResonator
from turnout.physics.ballast_hardening import BallastHardening
from turnout.physics.ballast_inertia import BallastInertia
from turnout.physics.clipping import Clipping
from turnout.physics.clock_drift import ClockDrift
from turnout.physics.contact_stiffness import ContactStiffness
from turnout.physics.dry_friction import DryFriction
from turnout.physics.hammer_delay import HammerDelay
from turnout.physics.hammer_gain import HammerGain
from turnout.physics.hanging_sleeper import HangingSleeper
from turnout.physics.heel_support import HeelSupport
from turnout.physics.high_pass import HighPass
from turnout.physics.hum import Hum
from turnout.physics.lifting_sleepers import LiftingSleepers
from turnout.physics.local_ballast import LocalBallast
from turnout.physics.local_pad import LocalPad
from turnout.physics.loose_fastening import LooseFastening
from turnout.physics.low_pass import LowPass
from turnout.physics.mount_resonance import MountResonance
from turnout.physics.out_of_round import OutOfRound
from turnout.physics.pad_preload import PadPreload
from turnout.physics.pad_temperature import PadTemperature
from turnout.physics.passage_delay import PassageDelay
from turnout.physics.passage_gain import PassageGain
from turnout.physics.rail_bending import RailBending
from turnout.physics.rail_corrugation import RailCorrugation
from turnout.physics.rail_shear import RailShear
from turnout.physics.roughness_level import RoughnessLevel
from turnout.physics.sensor_gain import SensorGain
from turnout.physics.sensor_position import SensorPosition
from turnout.physics.sleeper_mode import SleeperMode
from turnout.physics.slide_chair_gap import SlideChairGap
from turnout.physics.surface_dip import SurfaceDip
from turnout.physics.term import Parameter, PhysicsTerm
from turnout.physics.time_offset import TimeOffset
from turnout.physics.unsprung_mass import UnsprungMass
from turnout.physics.wheel_flat import WheelFlat
from turnout.physics.worn_toe import WornToe
from turnout.physics.zener_pad import ZenerPad

# In the order in which a diagnosis tests them at one site. Where two explain the recordings alike, the first one leads:
# ballast is before a hanging sleeper, which looks like soft ballast to a hammer.
TERMS: tuple[type[PhysicsTerm], ...] = (
    LocalBallast,
    LocalPad,
    HangingSleeper,
    LooseFastening,
    AttachedResonator,
    DryFriction,
    BallastHardening,
    PadTemperature,
    PadPreload,
    ZenerPad,
    RailShear,
    BallastInertia,
    SleeperMode,
    SensorGain,
    MountResonance,
    TimeOffset,
    SensorPosition,
    LowPass,
    HighPass,
    PassageDelay,
    PassageGain,
    HammerDelay,
    HammerGain,
    ClockDrift,
    Clipping,
    Hum,
    SurfaceDip,
    RailCorrugation,
    ContactStiffness,
    UnsprungMass,
    WheelFlat,
    OutOfRound,
    SlideChairGap,
    HeelSupport,
    WornToe,
    LiftingSleepers,
    RailBending,
    RoughnessLevel,
)


def effects_by_name() -> dict[str, type[PhysicsTerm]]:
    """All effects.

    Returns
    -------
    dict
        Class of the effect by its name.
    """
    return {term.name: term for term in TERMS}


__all__ = ["TERMS", "Parameter", "PhysicsTerm", "effects_by_name", *(term.__name__ for term in TERMS)]
