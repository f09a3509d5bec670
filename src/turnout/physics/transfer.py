"""Effects in a measuring channel that are linear: one transfer function serves recordings and receptances."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.physics.term import PhysicsTerm

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from turnout.simulate.sensor import Sensor


class TransferTerm(PhysicsTerm):
    """A term of one channel, named by its field ``channel_name``, with ``transfer(frequency)`` complex (n,)."""

    channel_name: str
    effect_type = "channel"
    frame = "sensor"

    def transfer(self, frequency: ArrayLike) -> np.ndarray:
        """Factor on the spectrum of the channel.

        Parameters
        ----------
        frequency : (n,) array of float
            Frequencies. [Hz]

        Returns
        -------
        (n,) array of complex
            Recorded signal over true signal.
        """
        raise NotImplementedError

    def channel(self, signal: np.ndarray, rate: float, sensor: Sensor) -> np.ndarray:
        """The signal with the transfer function applied, padded so that it does not wrap around."""
        self.check()
        if sensor.name != self.channel_name:
            return signal
        signal = np.asarray(signal, dtype=float)
        from scipy.fft import next_fast_len  # not at module level: pages read names of effects without scipy

        n = next_fast_len(signal.size + max(2048, signal.size // 8), real=True)
        frequency = np.fft.rfftfreq(n, 1.0 / rate)
        return np.fft.irfft(np.fft.rfft(signal, n) * self.transfer(frequency), n)[: signal.size]
