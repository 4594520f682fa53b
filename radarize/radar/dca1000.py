"""The DCA1000 capture board: order of the samples that it passes on, and its UDP data packets.

Two-lane LVDS, complex samples (TI SWRA581, SPRUIJ4): per chirp all samples of the first receiver, then the second, ...;
words of 16 bits in groups of four, two complex samples: ``I0 I1 Q0 Q1`` (mmWave Studio) or ``Q0 Q1 I0 I1`` (SDK demo).
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int16

from radarize.errors import InputError
from radarize.radar.config import RadarConfig

DATA_PORT = 4098
MAX_PAYLOAD = 1456
_ONES = bytes([1]) * MAX_PAYLOAD
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
    def decode(cls, data: bytes) -> "Packet":
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


@dataclass
class PacketCounts:
    """What became of a capture's packets.

    Attributes:
        received, duplicates, late, damaged: packets that were used, held nothing new, came (perhaps again) after their
            frame was given out, or had an impossible header or length.
        lost_bytes: of the frames given out, that never came.
        incomplete_bytes: that had come of a last frame that is not whole.
    """

    received: int = 0
    duplicates: int = 0
    late: int = 0
    damaged: int = 0
    lost_bytes: int = 0
    incomplete_bytes: int = 0

    def warnings(self) -> list[str]:
        """What the user should know."""
        found = (
            (self.incomplete_bytes, "bytes of an incomplete last frame are left out"),
            (self.lost_bytes, "bytes were lost, their chirps are marked"),
            (self.late, "data packets came too late or again and are ignored"),
            (self.damaged, "data packets have an impossible header or length and are ignored"),
        )
        return [f"{count} {words}" for count, words in found if count]


class _PartialFrame:
    """Bytes of a frame that have arrived so far.

    Bytearrays, since at 60,000 packets a second numpy's cost per call would be too much.
    """

    def __init__(self, size: int):
        self.data = bytearray(size)
        self.arrived = bytearray(size)  # 1 where data came
        self.missing = size

    def place(self, start: int, part: memoryview) -> int:
        """Put bytes where they belong; returns how many of them had not come before."""
        end = start + len(part)
        fresh = len(part) - self.arrived.count(1, start, end)
        self.data[start:end] = part
        self.arrived[start:end] = _ONES[: len(part)]
        self.missing -= fresh
        return fresh


class FrameAssembler:
    """Puts frames together from packets that come late, twice, out of order, or never.

    A payload belongs where its byte count says, so a lost packet never shifts what follows. A frame is given out, in
    order, when it is whole or when the newest byte is `window` bytes past its end; what is missing then is zero, and
    the chirps it belongs to are marked.

    Args:
        window: how far behind the newest byte a late packet is still accepted.
        max_jump: a byte count further than this past the newest one is taken for a damaged header.
    """

    def __init__(self, config: RadarConfig, window: int = 1 << 20, max_jump: int = 1 << 28):
        check_layout(config)
        self.config = config
        self._size = config.frame_bytes
        self.window = window
        self.max_jump = max_jump
        self.counts = PacketCounts()
        self._started = False
        self._next = 0  # number of the frame to be given out next
        self._newest = 0  # end of the furthest payload so far
        self._partial: dict[int, _PartialFrame] = {}

    def take(self, data: bytes) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """As `add`, with a UDP payload; one that is no data packet is counted as damaged."""
        try:
            packet = Packet.decode(data)
        except InputError:
            self.counts.damaged += 1
            return
        yield from self.add(packet)

    def add(self, packet: Packet) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Take a packet; yields frames that are now settled, as `_settle` describes."""
        end = packet.offset + len(packet.payload)
        if not self._started:
            self._started = True
            if packet.offset > self.window:  # listening began in the middle of a capture
                self._next, self._newest = -(-packet.offset // self._size), packet.offset
        if end > self._newest + self.max_jump:
            self.counts.damaged += 1
            return
        self._place(packet)
        self._newest = max(self._newest, end)
        size = self._size
        while self._newest >= (self._next + 1) * size + self.window or self._whole(self._next):
            yield self._settle()

    def finish(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """No packet will come any more: yields the frames left whose last byte, or a later one, has come."""
        size = self._size
        while self._newest >= (self._next + 1) * size:
            yield self._settle()
        self.counts.incomplete_bytes = sum(len(p.data) - p.missing for p in self._partial.values())
        self._partial.clear()

    def _place(self, packet: Packet) -> None:
        size = self._size
        payload = memoryview(packet.payload)
        taken = fresh = 0
        while taken < len(payload):
            number, start = divmod(packet.offset + taken, size)
            part = payload[taken : taken + size - start]
            taken += len(part)
            if number < self._next:
                continue
            if (partial := self._partial.get(number)) is None:
                partial = self._partial[number] = _PartialFrame(size)
            fresh += partial.place(start, part)
        if fresh:
            self.counts.received += 1
        elif packet.offset + len(payload) <= self._next * size:
            self.counts.late += 1
        else:
            self.counts.duplicates += 1

    def _whole(self, number: int) -> bool:
        return number in self._partial and not self._partial[number].missing

    def _settle(self) -> tuple[Int16[np.ndarray, "word"], Bool[np.ndarray, "loop tx"]]:
        """Give out the next frame: its words as captured, for `decode`, and which chirps (physical order) are whole."""
        partial = self._partial.pop(self._next, None) or _PartialFrame(self._size)
        self._next += 1
        self.counts.lost_bytes += partial.missing
        loops, tx = self.config.frame_shape[:2]
        fired = np.frombuffer(partial.arrived, bool).reshape(loops, tx, -1).all(axis=2)
        words = np.frombuffer(partial.data, "<i2").astype(np.int16, copy=False)
        return words, fired[:, list(self.config.slot)]
