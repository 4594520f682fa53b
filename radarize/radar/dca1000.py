"""The DCA1000 capture board: order of the samples that it passes on, and its UDP data packets.

Two-lane LVDS, complex samples (TI SWRA581, SPRUIJ4): per chirp all samples of the first receiver, then the second, ...;
words of 16 bits in groups of four, two complex samples: ``I0 I1 Q0 Q1`` (mmWave Studio) or ``Q0 Q1 I0 I1`` (SDK demo).
"""

import struct
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int16

from radarize.io.errors import InputError
from radarize.radar.config import RadarConfig

DATA_PORT = 4098
MAX_PAYLOAD = 1456
HEADER = struct.Struct("<IIH")  # sequence from 1; bytes sent before this packet, 48 bits


# --- samples ----------------------------------------------------------------------------------------------------------
def check_layout(config: RadarConfig) -> None:
    """Refuse a sample count that does not fill the groups of two complex samples.

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
    chirps = raw.reshape(-1, loops, tx, rx, samples // 2, 2, 2)  # ..., group, iq, sample of the pair
    if config.iq_order == "qqii":
        chirps = chirps[..., ::-1, :]
    physical = chirps if config.slot == tuple(range(tx)) else chirps[:, :, list(config.slot)]
    return np.ascontiguousarray(physical.swapaxes(-1, -2)).reshape(-1, loops, tx, rx, samples, 2)


def encode(frames: Int16[np.ndarray, "frame loop tx rx sample 2"], config: RadarConfig) -> Int16[np.ndarray, "word"]:
    """The words that a DCA1000 would have captured: the inverse of `decode`.

    Raises:
        InputError: the frames do not have the configuration's shape, or `samples` is odd.
    """
    check_layout(config)
    if frames.shape[1:] != config.frame_shape:
        raise InputError(f"frames have shape {frames.shape[1:]}, expected {config.frame_shape}")
    loops, tx, rx, samples, _ = config.frame_shape
    fired = frames[:, :, [config.tx.index(t) for t in config.tx_order]]
    groups = fired.reshape(-1, loops, tx, rx, samples // 2, 2, 2).swapaxes(-1, -2)
    if config.iq_order == "qqii":
        groups = groups[..., ::-1, :]
    return np.ascontiguousarray(groups, dtype=np.int16).reshape(-1)


def range_balance(frames: Int16[np.ndarray, "frame loop tx rx sample 2"]) -> float:
    """Energy of the beat spectrum's lower half against the upper one, dB: negative where I and Q are swapped.

    Echoes are near, with leakage nearest of all, so the lower half holds more energy (+14 to +36 dB on real captures);
    swapping I and Q mirrors range. Small values mean undecided; 0 is silence.
    """
    samples = frames.shape[-2]
    signal = np.ascontiguousarray(frames, np.float32).view(np.complex64).reshape(-1, samples)
    signal = signal - signal.mean(axis=1, keepdims=True)
    power = (np.abs(np.fft.fft(signal * np.hanning(samples), axis=1)) ** 2).sum(axis=0)
    half, skip = samples // 2, 2  # the window smears the offset into two bins
    near, far = power[skip:half].sum(), power[half + 1 : samples - skip + 1].sum()
    return float(10 * np.log10(near / far)) if near > 0 and far > 0 else 0.0


# --- packets ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Packet:
    """A data packet.

    Attributes:
        sequence: from 1.
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
