"""Effects in a measuring channel that are linear: one transfer function serves recordings and receptances."""

import numpy as np
from scipy.fft import next_fast_len

from turnout.physics.term import PhysicsTerm


class TransferTerm(PhysicsTerm):
    """A term of one channel, named by its field ``channel_name``, with ``transfer(frequency)`` complex (n,)."""

    channel_name: str
    effect_type = "channel"
    frame = "sensor"

    def transfer(self, frequency):
        """(n,) complex factor on the spectrum at ``frequency`` [Hz]."""
        raise NotImplementedError

    def channel(self, signal, rate, sensor):
        """The signal with the transfer function applied, padded so that it does not wrap around."""
        self.check()
        if sensor.name != self.channel_name:
            return signal
        signal = np.asarray(signal, dtype=float)
        n = next_fast_len(signal.size + max(2048, signal.size // 8), real=True)
        frequency = np.fft.rfftfreq(n, 1.0 / rate)
        return np.fft.irfft(np.fft.rfft(signal, n) * self.transfer(frequency), n)[: signal.size]
