"""Front end: from the field at the antennas to ADC counts, in the order of a receiver's stages:

    amplify     transmit power, receive gain, gain and phase of each channel
    couple      leakage from TX to RX, echoes of the mount
    disturb     phase noise on every echo (range-correlated), thermal noise coloured by the decimation filter
    mix         the image of an imperfect I/Q mixer
    convert     saturation and rounding

The IF filters act on echoes, by path length, before the synthesis (`if_response`). `FrontEndConfig` has the settings
of each stage; noise and filters are computed in frequency bins, where filters are products.
"""

from functools import cached_property

import numpy as np
import scipy.fft
from jaxtyping import Complex, Float, Int16

from radarize.io.errors import InputError
from radarize.radar.boards import load_board
from radarize.radar.config import SPEED_OF_LIGHT, RadarConfig, fired
from radarsim.receiver.frontend_config import FrontEndConfig, MountEcho
from radarsim.receiver.phasenoise import Sidebands

BOLTZMANN = 1.380649e-23
ROOM_TEMPERATURE = 290.0


class FrontEnd:
    """Analogue and digital front end of one board.

    Args:
        config: radar configuration; with receive gain, transmit back-off, filter corners, sample rate.
        settings: settings of the front end; default: those of the board's file.
        rng: random generator of a board's constants: mismatch, leakage, mount echoes. Default: board number 0.

    Attributes:
        channel: complex gain of each channel.
        leakage: amplitude of the leakage (square root of received over transmitted power) before the high-pass filter.
        mount: amplitudes of the mount's echoes, likewise.
    """

    channel: Complex[np.ndarray, "tx rx"]
    leakage: Complex[np.ndarray, "tx rx"]
    mount: Complex[np.ndarray, "echo tx rx"]

    def __init__(
        self,
        config: RadarConfig,
        settings: FrontEndConfig | None = None,
        rng: np.random.Generator | None = None,
    ):
        self.config, self.settings = config, settings or FrontEndConfig.of(config.board)
        if any(len(fired(firing)) > 1 for firing in config.tx_order):
            raise InputError(f"radar: tx_order is {config.tx_order}, expected one transmitter a chirp to simulate")
        self._board = load_board(config.board)
        rng = np.random.default_rng(0) if rng is None else rng
        enabled = config.channels
        # Some boards feed antennas from the far side of the patch.
        self.channel = (self._draw_channel(rng) * self._board.signs)[enabled]
        self.leakage = self._draw_leakage(rng)[enabled]
        echoes = [self._draw_mount(echo, rng)[enabled] for echo in self.settings.mount or ()]
        self.mount = np.array(echoes, complex).reshape(-1, *self.leakage.shape)
        self._bins = np.arange(config.samples) * config.sample_rate / config.samples
        self._sidebands = None
        if self.settings.phase_noise:
            response = np.abs(self.beat_response(self._bins))
            self._sidebands = Sidebands(config, self.settings.phase_noise, response)

    @property
    def _shape(self) -> tuple[int, int]:
        """Transmitters and receivers of the board, enabled or not."""
        return len(self._board.tx), len(self._board.rx)

    def _draw_channel(self, rng: np.random.Generator) -> Complex[np.ndarray, "tx rx"]:
        mismatch, (tx, rx) = self.settings.mismatch, self._shape
        errors = rng.uniform(-0.5, 0.5, (2, tx + rx))  # drawn in any case: the same seed gives the same board
        if mismatch is None:
            return np.ones((tx, rx), complex)
        if mismatch.channels:
            return mismatch.measured(self._board)
        factor = 10 ** (mismatch.gain_db * errors[0] / 20) * np.exp(1j * np.deg2rad(mismatch.phase_deg) * errors[1])
        return factor[:tx, None] * factor[None, tx:]

    def _draw_leakage(self, rng: np.random.Generator) -> Complex[np.ndarray, "tx rx"]:
        leakage = self.settings.leakage
        phase = rng.uniform(0, 2 * np.pi, self._shape)
        if leakage is None:
            return np.zeros(self._shape, complex)
        measured = leakage.channels is not None
        return leakage.measured(self._board) if measured else 10 ** (leakage.level_db / 20) * np.exp(1j * phase)

    def _draw_mount(self, echo: MountEcho, rng: np.random.Generator) -> Complex[np.ndarray, "tx rx"]:
        normal = rng.standard_normal((*self._shape, 2)).view(complex)[..., 0] * np.sqrt(0.5)
        return echo.measured(self._board) if echo.channels else 10 ** (echo.level_db / 20) * normal

    # --- levels ------------------------------------------------------------------------------------------------------
    @property
    def tx_power(self) -> float:
        """Transmitted power, W."""
        return 1e-3 * 10 ** ((self.settings.tx_power_dbm - self.config.tx_backoff_db) / 10)

    @cached_property
    def noise_power(self) -> float:
        """Noise power of a complex sample at the receiver's input, k T B F, W, whether switched on or not."""
        factor = self.settings.noise_factor(self.config.rx_gain_db)
        return BOLTZMANN * ROOM_TEMPERATURE * self.config.sample_rate * factor

    @property
    def counts(self) -> float:
        """ADC counts per square root of a watt at the receiver's input."""
        return 32767 * 10 ** ((self.config.rx_gain_db - self.settings.full_scale_dbm) / 20) / np.sqrt(1e-3)

    @property
    def scale(self) -> float:
        """ADC counts per unit of echo amplitude."""
        return self.counts * np.sqrt(self.tx_power)

    @property
    def weakest(self) -> float:
        """Echo amplitude (square root of received over transmitted power) 10 dB below the noise of a whole burst."""
        loops, tx, rx, samples, _ = self.config.frame_shape
        return float(np.sqrt(0.1 * self.noise_power / (loops * tx * rx * samples) / self.tx_power))

    # --- filters -----------------------------------------------------------------------------------------------------
    @property
    def passband(self) -> tuple[float, float]:
        """Beat frequencies between which anything passes, Hz."""
        band, rate, edge = self.settings.band, self.config.sample_rate, self.settings.if_bandwidth_hz
        return (-edge, edge) if band is None else (band.low * rate, band.high * rate)

    def if_response(self, path_length: Float[np.ndarray, "*n"] | float) -> Complex[np.ndarray, "*n"]:
        """Response of the IF chain to an echo of a path length (out and back, m)."""
        return self.beat_response(self.config.slope * np.asarray(path_length) / SPEED_OF_LIGHT)

    def beat_response(self, beat: Float[np.ndarray, "*n"] | float) -> Complex[np.ndarray, "*n"]:
        """Response at beat frequencies, Hz: two first-order high-pass stages, then the decimation filter."""
        response = self._decimation(np.asarray(beat)).astype(complex)
        if self.settings.high_pass:
            for corner in self.config.high_pass:
                response = response * (1j * beat / (1j * beat + corner))
        return np.asarray(response)

    def _decimation(self, beat: np.ndarray) -> np.ndarray:
        band = self.settings.band
        return np.ones(beat.shape) if band is None else np.asarray(band.response(beat / self.config.sample_rate))

    # --- the chain ---------------------------------------------------------------------------------------------------
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
        return self.convert(self.receive(signal, rng))

    def receive(
        self, signal: Complex[np.ndarray, "loop tx rx sample"], rng: np.random.Generator
    ) -> Complex[np.ndarray, "loop tx rx sample"]:
        """Signal at the input of the converter, in counts; arguments as for `digitize`."""
        echoes = self._amplify(signal)
        extra = self._thermal(echoes.shape, rng)
        if self._sidebands or self.settings.image_rejection_db is not None:
            bins = scipy.fft.fft(echoes, axis=-1, norm="forward")
        if self._sidebands:
            noise = self._bin_noise if self.settings.noise else 0.0
            extra += self._sidebands(bins, *self._static, noise, rng)
        leakage = self._coupled
        if (rejection := self.settings.image_rejection_db) is not None:
            extra += self._image(bins + scipy.fft.fft(leakage, axis=-1, norm="forward") + extra, rejection)
        return echoes + leakage + scipy.fft.ifft(extra, axis=-1, norm="forward")

    def convert(self, counts: Complex[np.ndarray, "loop tx rx sample"]) -> Int16[np.ndarray, "loop tx rx sample 2"]:
        """Saturated at full scale and rounded to the converter's steps."""
        step = 2 ** (16 - self.settings.adc_bits)
        iq = np.ascontiguousarray(counts, np.complex64).view(np.float32)
        steps = np.clip(np.rint(iq / np.float32(step)), -32768 // step, 32767 // step)
        return (steps * step).astype(np.int16).reshape(*counts.shape, 2)

    def by_path_type(
        self, signals: list[Complex[np.ndarray, "loop tx rx sample"]]
    ) -> list[Complex[np.ndarray, "loop tx rx sample"]]:
        """Counts that each of several signals makes without noise and converter, and last those of leakage and mount.

        Their sum is what `receive` returns for the sum of the signals with thermal and phase noise off.
        """
        shape = self.config.frame_shape[:-1]
        parts = [self._amplify(s) for s in signals] + [np.broadcast_to(self._coupled, shape)]
        if (rejection := self.settings.image_rejection_db) is None:
            return parts
        images = (self._image(scipy.fft.fft(p, axis=-1, norm="forward"), rejection) for p in parts)
        return [p + scipy.fft.ifft(i, axis=-1, norm="forward") for p, i in zip(parts, images, strict=True)]

    @property
    def _bin_noise(self) -> float:
        """Thermal noise power of a Fourier coefficient, counts^2."""
        return self.counts**2 * self.noise_power / self.config.samples

    def _amplify(self, signal: Complex[np.ndarray, "loop tx rx sample"]) -> Complex[np.ndarray, "loop tx rx sample"]:
        return np.asarray(signal, np.complex64) * (self.scale * self.channel).astype(np.complex64)[:, :, None]

    @cached_property
    def _static(self) -> tuple[Complex[np.ndarray, "echo tx rx"], Float[np.ndarray, "echo"]]:
        """Leakage and echoes of the mount: amplitudes in counts before the high-pass filter, and delays, s."""
        leakage, mount = self.settings.leakage, self.settings.mount or ()
        delays = np.array([leakage.delay if leakage else 0.0, *(echo.delay for echo in mount)])
        return (self.scale * np.concatenate([self.leakage[None], self.mount])).astype(np.complex64), delays

    @cached_property
    def _coupled(self) -> Complex[np.ndarray, "tx rx sample"]:
        """Leakage and echoes of the mount: a tone each, the same in every chirp."""
        amplitudes, delays = self._static
        n = self.config.samples
        beat = self.config.slope * delays
        tones = np.exp(2j * np.pi * np.outer(beat, np.arange(n) - (n - 1) / 2) / self.config.sample_rate)
        return np.einsum("etr,es->trs", amplitudes, self.beat_response(beat)[:, None] * tones).astype(np.complex64)

    def _thermal(self, shape: tuple[int, ...], rng: np.random.Generator) -> Complex[np.ndarray, "loop tx rx sample"]:
        """Thermal noise by bin, coloured by the decimation filter; without one, that of a sample rate's width."""
        if not self.settings.noise:
            return np.zeros(shape, np.complex64)
        band, x = self.settings.band, self._bins / self.config.sample_rate
        level = np.sqrt(self._bin_noise / 2 * (1.0 if band is None else band.noise(x)))
        draw = rng.standard_normal((*shape, 2), dtype=np.float32).view(np.complex64)[..., 0]
        return draw * np.float32(level)

    def _image(
        self, bins: Complex[np.ndarray, "*trace sample"], rejection: float
    ) -> Complex[np.ndarray, "*trace sample"]:
        """Image of bin b at -b, `rejection` dB below it, within the decimation filter's band; -b is bin N - b."""
        passed = 10 ** (-rejection / 20) * self._decimation(-self._bins)
        # conj(x(t)) has the conjugate coefficients in mirrored order
        image = np.zeros_like(bins)
        some = np.flatnonzero(passed)
        image[..., -some % self.config.samples] = passed[some].astype(np.float32) * bins[..., some].conj()
        return image
