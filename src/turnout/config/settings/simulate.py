"""Settings of the simulation: integration scheme, rates, simulated length of track and time."""

from dataclasses import dataclass

from turnout.config.settings.setting import setting


@dataclass(frozen=True)
class SimulateSettings:
    """How hammer tests and passages are simulated by `turnout simulate`."""

    scheme: str = setting(
        "radau",
        why="L-stable, 1.6 % error to 1 kHz at 1e-4 s where the midpoint rule (Newmark) has 15 %",
        choices=("radau", "gauss", "midpoint"),
    )
    rate: float = setting(20000.0, "Hz", "rate of the paper; used where the layout states none", 1000.0, 200000.0)
    substeps: int = setting(1, "", "time steps per sample; 2 halves the step, as numerical_error does", 1, 64)
    entry: float = setting(
        6.0, "m", "length over which wheels roll from their stand-in on to the modelled track: error 1e-4", 1.0, 50.0
    )
    lead: float = setting(1.0, "s", "quiet time before the first wheel reaches the first sensor", 0.1, 60.0)
    tail: float = setting(1.0, "s", "time after the last wheel has left the last sensor", 0.1, 60.0)
    hammer_duration: float = setting(0.15, "s", "length of a hammer record, as in the demonstration", 0.02, 10.0)
    hammer_pretrigger: float = setting(0.005, "s", "part of it before the impact", 0.0, 1.0)
    hammer_half_length: float = setting(
        30.0, "m", "track marched on both sides of an impact; waves of 80-800 Hz have decayed by 40 dB", 5.0, 500.0
    )
