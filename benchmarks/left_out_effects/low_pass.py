"""A channel with two RC stages in series, whose corners are equal and far below that of the file."""

from scipy import signal

from turnout_blind.effect import Effect, draw_sensor


def draw(rng, site, corner):
    """The sensor and its corner [Hz]."""
    return draw_sensor(rng, site), {"corner": float(corner)}


def act(world, site, where, p):
    """Add the fault to the channel, in hammer tests and passages."""

    def fault(recording_type, rng):
        def record(x, rate):
            for _ in range(2):
                x = signal.sosfilt(signal.butter(1, p["corner"], fs=rate, output="sos"), x)
            return x

        return record

    world.channels.setdefault(where["sensor"], []).append(fault)


EFFECT = Effect("low_pass", "sensor", (2500.0, 1600.0, 1000.0, 700.0, 500.0, 350.0, 220.0), draw, act)
