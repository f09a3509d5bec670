"""A channel that loses low frequencies: a charge amplifier and its coupling, one corner four times the other."""

from scipy import signal

from turnout_blind.effect import Effect, draw_sensor


def draw(rng, site, corner):
    """The sensor and its larger corner [Hz]."""
    return draw_sensor(rng, site), {"corner": float(corner)}


def act(world, site, where, p):
    """Add the fault to the channel, in hammer tests and passages."""

    def fault(recording_type, rng):
        def record(x, rate):
            for corner in (p["corner"], 0.25 * p["corner"]):
                x = signal.sosfilt(signal.butter(1, corner, "high", fs=rate, output="sos"), x)
            return x

        return record

    world.channels.setdefault(where["sensor"], []).append(fault)


EFFECT = Effect("high_pass", "sensor", (1.0, 2.0, 4.0, 8.0, 14.0, 24.0, 40.0), draw, act)
