"""Effects that a simulation may have left out, one per file. A new one is a new file and a line in TERMS.

Every listed term is put through the contract tests: it vanishes at its neutral value, leaves a resting track
alone, has units and sources, and says in words what was left out.
"""

from turnout.physics.attached_resonator import AttachedResonator
from turnout.physics.ballast_hardening import BallastHardening
from turnout.physics.ballast_inertia import BallastInertia
from turnout.physics.clipping import Clipping
from turnout.physics.clock_drift import ClockDrift
from turnout.physics.contact_stiffness import ContactStiffness
from turnout.physics.dry_friction import DryFriction
from turnout.physics.hanging_sleeper import HangingSleeper
from turnout.physics.high_pass import HighPass
from turnout.physics.hum import Hum
from turnout.physics.lifting_sleepers import LiftingSleepers
from turnout.physics.local_ballast import LocalBallast
from turnout.physics.local_pad import LocalPad
from turnout.physics.low_pass import LowPass
from turnout.physics.mount_resonance import MountResonance
from turnout.physics.out_of_round import OutOfRound
from turnout.physics.pad_preload import PadPreload
from turnout.physics.pad_temperature import PadTemperature
from turnout.physics.rail_bending import RailBending
from turnout.physics.rail_corrugation import RailCorrugation
from turnout.physics.rail_shear import RailShear
from turnout.physics.roughness_level import RoughnessLevel
from turnout.physics.sensor_gain import SensorGain
from turnout.physics.sensor_position import SensorPosition
from turnout.physics.sleeper_mode import SleeperMode
from turnout.physics.surface_dip import SurfaceDip
from turnout.physics.term import Parameter, PhysicsTerm
from turnout.physics.time_offset import TimeOffset
from turnout.physics.unsprung_mass import UnsprungMass
from turnout.physics.wheel_flat import WheelFlat
from turnout.physics.zener_pad import ZenerPad

TERMS = (
    AttachedResonator,
    BallastHardening,
    BallastInertia,
    Clipping,
    ClockDrift,
    ContactStiffness,
    DryFriction,
    HangingSleeper,
    HighPass,
    Hum,
    LiftingSleepers,
    LocalBallast,
    LocalPad,
    LowPass,
    MountResonance,
    OutOfRound,
    PadPreload,
    PadTemperature,
    RailBending,
    RailCorrugation,
    RailShear,
    RoughnessLevel,
    SensorGain,
    SensorPosition,
    SleeperMode,
    SurfaceDip,
    TimeOffset,
    UnsprungMass,
    WheelFlat,
    ZenerPad,
)

__all__ = ["TERMS", "Parameter", "PhysicsTerm", *(term.__name__ for term in TERMS)]
