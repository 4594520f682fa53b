"""From the field at the antennas to ADC counts: transmit power, IF filter, thermal noise, converter."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int16

from radarize.radar.config import SPEED_OF_LIGHT, RadarConfig

BOLTZMANN = 1.380649e-23
ROOM_TEMPERATURE = 290.0


@dataclass(frozen=True)
class FrontEnd:
    """The analogue and digital front end of the IWR1843.

    Attributes:
        config: radar configuration; gives receive gain, transmit back-off, filter corners, sample rate.
        tx_power_dbm: per transmitter at no back-off (data sheet SWRS228: 12 dBm).
        noise_figure_db: at 30 dB receive gain in 77-81 GHz (15.6 dB).
        full_scale_dbm: power of a complex tone of 32767 counts after the receive gain. Not in the data sheet; 5 dBm
            puts the noise floor at 10.6 counts in the `radarize` preset, as against 14 counts (4 to 5 Msps) in real
            captures. All 16 bits carry signal there, so the converter rounds to one count.
        noise: whether thermal noise is added.
    """

    config: RadarConfig
    tx_power_dbm: float = 12.0
    noise_figure_db: float = 15.6
    full_scale_dbm: float = 5.0
    noise: bool = True

    @property
    def tx_power(self) -> float:
        """Transmitted power, W."""
        return 1e-3 * 10 ** ((self.tx_power_dbm - self.config.tx_backoff_db) / 10)

    @property
    def noise_power(self) -> float:
        """Noise power of a complex sample at the receiver's input, k T B F, W."""
        return BOLTZMANN * ROOM_TEMPERATURE * self.config.sample_rate * 10 ** (self.noise_figure_db / 10)

    @property
    def counts(self) -> float:
        """ADC counts per square root of a watt at the receiver's input."""
        return 32767 * 10 ** ((self.config.rx_gain_db - self.full_scale_dbm) / 20) / np.sqrt(1e-3)

    @property
    def weakest(self) -> float:
        """Echo amplitude (square root of received over transmitted power) 10 dB below the noise of a whole burst."""
        loops, tx, rx, samples, _ = self.config.frame_shape
        return float(np.sqrt(0.1 * self.noise_power / (loops * tx * rx * samples) / self.tx_power))

    def if_response(self, path_length: Float[np.ndarray, "*n"]) -> Complex[np.ndarray, "*n"]:
        """Response of the IF chain to an echo of a path length (out and back, m): high-pass stages and band limit.

        Two first-order high-pass stages, then the decimation filter: flat to 0.9 of the sample rate, 6 dB down at 1
        (the noise of real captures falls by 2 to 9 dB in the last sixteenth of the bins) and closed from 1.1 on.
        """
        beat = self.config.slope * np.asarray(path_length) / SPEED_OF_LIGHT
        first, second = self.config.high_pass
        high_pass = (1j * beat / (1j * beat + first)) * (1j * beat / (1j * beat + second))
        return high_pass * self._decimation(beat)

    def _decimation(self, beat: np.ndarray) -> np.ndarray:
        return np.interp(beat / self.config.sample_rate, [-0.1, 0.0, 0.9, 1.0, 1.1], [0.0, 1.0, 1.0, 0.5, 0.0])

    def digitize(
        self, signal: Complex[np.ndarray, "loop tx rx sample"], rng: np.random.Generator
    ) -> Int16[np.ndarray, "loop tx rx sample 2"]:
        """Counts of a received signal.

        Args:
            signal: square root of received over transmitted power, IF response included.
            rng: for the noise.

        Returns:
            I and Q, rounded and saturated.
        """
        scale = self.counts * np.sqrt(self.tx_power)
        iq = np.ascontiguousarray(signal * np.float32(scale), np.complex64)
        if self.noise:
            # Drawn per frequency bin, where the decimation filter colours it, then transformed.
            n = self.config.samples
            bins = np.arange(n) * self.config.sample_rate / n
            level = self.counts * np.sqrt(self.noise_power * n / 2) * self._decimation(bins)
            draw = rng.standard_normal((*iq.shape, 2), dtype=np.float32).view(np.complex64)[..., 0]
            iq = iq + np.fft.ifft(draw * level.astype(np.float32), axis=-1)
        return np.clip(np.rint(iq.view(np.float32)), -32768, 32767).astype(np.int16).reshape(*iq.shape, 2)
