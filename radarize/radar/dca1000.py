"""DCA1000 capture board: sample order of its data stream, and its UDP data packets.

Two-lane LVDS, complex samples (TI SWRA581, SPRUIJ4): per chirp all samples of the first receiver, then the second, ...;
words of 16 bits in groups of four, two complex samples: ``I0 I1 Q0 Q1`` (mmWave Studio) or ``Q0 Q1 I0 I1`` (SDK demo).
Chips without complex samples send one word per real one. Real samples are converted to complex ones, and binary phase
modulation is demodulated: decoded samples have the same form for all.
"""

import struct
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int16

from radarize.io.errors import InputError
from radarize.radar.config import RadarConfig

DATA_PORT = 4098
MAX_PAYLOAD = 1456
HEADER = struct.Struct("<IIH")  # sequence from 1; bytes sent before this packet, 48 bits


# --- samples ----------------------------------------------------------------------------------------------------------
def check_layout(config: RadarConfig) -> None:
    """Check that the samples fill groups of two complex samples.

    Raises:
        InputError: `samples` is odd.
    """
    if config.samples % 2:
        raise InputError(
            f"samples is {config.samples}, expected an even number: the DCA1000 packs complex samples in pairs"
        )


def decode(raw: Int16[np.ndarray, "word"], config: RadarConfig) -> Int16[np.ndarray, "frame loop tx rx sample 2"]:
    """Sort captured words into frames; transmitters in physical order, whatever order they fired in.

    Args:
        raw: words of whole frames.

    Raises:
        InputError: `raw` holds no whole number of frames, or `samples` is odd.
    """
    check_layout(config)
    loops, tx, rx, samples, _ = config.frame_shape
    words = config.frame_bytes // 2
    if raw.ndim != 1 or raw.size % words:
        raise InputError(
            f"{raw.size} words are {raw.size / words:.3f} frames, expected a multiple of {words} "
            f"({loops} loops x {tx} TX x {rx} RX x {samples} samples x 2)"
        )
    if config.iq_order == "real":
        chirps = _analytic(raw.reshape(-1, loops, tx, rx, 2 * samples))
    else:
        chirps = raw.reshape(-1, loops, tx, rx, samples // 2, 2, 2)  # ..., group, iq, sample of the pair
        if config.iq_order == "qqii":
            chirps = chirps[..., ::-1, :]
        chirps = chirps.swapaxes(-1, -2)
    physical = chirps if config.slot == tuple(range(tx)) else chirps[:, :, list(config.slot)]
    frames = np.ascontiguousarray(physical).reshape(-1, loops, tx, rx, samples, 2)
    return _demodulated(frames, config) if config.bpm else frames


def encode(frames: Int16[np.ndarray, "frame loop tx rx sample 2"], config: RadarConfig) -> Int16[np.ndarray, "word"]:
    """Words that a DCA1000 would have captured: the inverse of `decode` (to one count for real samples and for binary
    phase modulation).

    Raises:
        InputError: the frames do not have the configuration's shape, or `samples` is odd.
    """
    check_layout(config)
    if frames.shape[1:] != config.frame_shape:
        raise InputError(f"frames have shape {frames.shape[1:]}, expected {config.frame_shape}")
    loops, tx, rx, samples, _ = config.frame_shape
    if config.bpm:
        frames = _demodulated(frames, config, inverse=True)
    fired = frames[:, :, list(config.turn)]
    if config.iq_order == "real":
        return _real(fired).reshape(-1)
    groups = fired.reshape(-1, loops, tx, rx, samples // 2, 2, 2).swapaxes(-1, -2)
    if config.iq_order == "qqii":
        groups = groups[..., ::-1, :]
    return np.ascontiguousarray(groups, dtype=np.int16).reshape(-1)


def _analytic(real: Int16[np.ndarray, "... sample"]) -> Int16[np.ndarray, "... half 2"]:
    """Complex samples of the same beat signal: the upper half of the spectrum, which mirrors the lower one, is
    dropped."""
    spectrum = np.fft.rfft(real.astype(np.float32), axis=-1)[..., :-1]
    spectrum[..., 0] /= 2
    return _counts(np.fft.ifft(spectrum, axis=-1))


def _real(iq: Int16[np.ndarray, "... half 2"]) -> Int16[np.ndarray, "... sample"]:
    """Real samples of the same beat signal: the inverse of `_analytic`."""
    spectrum = np.fft.fft(iq[..., 0] + 1j * iq[..., 1], axis=-1)
    spectrum[..., 0] *= 2
    return _rounded(np.fft.irfft(spectrum, 2 * iq.shape[-2], axis=-1))


def _demodulated(
    frames: Int16[np.ndarray, "frame loop tx rx sample 2"], config: RadarConfig, inverse: bool = False
) -> Int16[np.ndarray, "frame loop tx rx sample 2"]:
    """Demodulate the two transmitters of binary phase modulation, each as if it had fired alone in its chirp; or
    modulate them again.

    One chirp has the sum of both transmitters' echoes, the other one their difference, a little later. Before they are
    added, each is shifted to the other's time by a phase ramp over its Doppler spectrum, as in TI's demos: exact for
    speeds within `config.max_velocity`. If the phase of an echo differs between the start and the end of a burst, the
    first and last loops contain a residual of the other transmitter, 25 dB or more below it after windowing over loops.
    """
    assert config.bpm is not None
    places = [config.turn[slot] for slot in config.bpm]
    first, second = (frames[:, :, place, ..., 0] + 1j * frames[:, :, place, ..., 1] for place in places)
    later = (config.bpm[1] - config.bpm[0]) * config.chirp_time / config.loop_time
    cycles = np.fft.fftfreq(config.loops)[:, None, None] * later

    def moved(chirps: np.ndarray, sign: int) -> np.ndarray:
        """Shift to a later (1) or earlier (-1) time by the interval between the two chirps."""
        return np.fft.ifft(np.fft.fft(chirps, axis=1) * np.exp(sign * 2j * np.pi * cycles), axis=1)

    scale = 1.0 if inverse else 0.5
    apart = scale * (first + moved(second, -1)), scale * (moved(first, 1) - second)
    result = frames.copy()
    for place, chirps in zip(places, apart, strict=True):
        result[:, :, place] = _counts(chirps)
    return result


def _counts(signal: Complex[np.ndarray, "..."]) -> Int16[np.ndarray, "... 2"]:
    return _rounded(np.stack([signal.real, signal.imag], axis=-1))


def _rounded(values: Float[np.ndarray, "..."]) -> Int16[np.ndarray, "..."]:
    limits = np.iinfo(np.int16)
    return values.round().clip(limits.min, limits.max).astype(np.int16)


def range_balance(frames: Int16[np.ndarray, "frame loop tx rx sample 2"]) -> float:
    """Energy of the beat spectrum's lower half relative to the upper one, dB: negative if I and Q are swapped.

    Echoes are near, with leakage nearest of all, so the lower half holds more energy (+14 to +36 dB on real captures);
    swapping I and Q mirrors range. Small values are not conclusive; 0 means no signal.
    """
    samples = frames.shape[-2]
    signal = np.ascontiguousarray(frames, np.float32).view(np.complex64).reshape(-1, samples)
    signal = signal - signal.mean(axis=1, keepdims=True)
    power = (np.abs(np.fft.fft(signal * np.hanning(samples), axis=1)) ** 2).sum(axis=0)
    half, skip = samples // 2, 2  # the window spreads the offset over two bins
    near, far = power[skip:half].sum(), power[half + 1 : samples - skip + 1].sum()
    return float(10 * np.log10(near / far)) if near > 0 and far > 0 else 0.0


# --- packets ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Packet:
    """A data packet.

    Attributes:
        sequence: number, from 1.
        offset: bytes sent before this packet.
        payload: at most `MAX_PAYLOAD` bytes.
    """

    sequence: int
    offset: int
    payload: bytes

    def encode(self) -> bytes:
        """UDP payload of the packet."""
        return HEADER.pack(self.sequence, self.offset & 0xFFFFFFFF, self.offset >> 32) + self.payload

    @classmethod
    def decode(cls, data: bytes | memoryview) -> "Packet":
        """Read a UDP payload.

        Raises:
            InputError: too short or too long for a data packet.
        """
        if not HEADER.size < len(data) <= HEADER.size + MAX_PAYLOAD:
            raise InputError(
                f"DCA1000 packet of {len(data)} bytes, expected {HEADER.size + 1} to {HEADER.size + MAX_PAYLOAD}"
            )
        sequence, low, high = HEADER.unpack_from(data)
        return cls(sequence, low | high << 32, bytes(data[HEADER.size :]))
