"""Where bytes are missing within a raw capture, or frames have another size from somewhere on.

A capture is nothing but words, so what is lost shifts all that follows. Chirps of one transmitter and receiver look
alike from loop to loop: where a loop does not look like the one before it, the place within the next bytes is sought
from which on it does. What lies between is lost, in whole loops.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Complex64, Float, Int16

from radarize.io.errors import explained
from radarize.radar.config import RadarConfig

#: Similarity of loops that follow each other, from which on a capture can be judged (frames looked at), or which share
#: of the usual one; and share below which a loop is looked at.
_ALIKE, _ASKED, _DIP = 0.5, 4, 0.7
#: Another place is believed with so much similarity, and so many times that of the present one; over the pause between
#: frames, with so much of the usual one: there, much changes.
_LEAST, _BETTER, _FOUND = 0.4, 1.5, 0.85
#: Bytes by which a place must differ, if by whole groups: where much moves, beats look alike after some samples.
_APART = 128
#: Groups of two samples around a place in which the joints between receivers are sought, and samples on either side.
_NEAR, _JOINT = 12, 6
#: Frames after a gap in which the pause between frames is sought, and how much less alike loops are over it.
_FOLDED, _PAUSE = 6, 0.8
#: Frames in a row that do not fit, after which a capture ends if its samples have another period from there on.
_MISFITS = 4
#: Bytes of two samples' I and Q.
_GROUP = 8

Loops = Complex64[np.ndarray, "_ channel sample"]
Read = Callable[[int, int], bytes]


@dataclass
class Pieces:
    """A capture as pieces of its files.

    Attributes:
        ranges: bytes of the files put end to end, and how many bytes are missing before them.
        gaps, missing: how often bytes are missing, and how many: at least, for whole loops may be, unseen.
        lost: bytes that came, but not of whole loops.
        ends: byte from which on frames have another size, if they have.
    """

    ranges: list[tuple[range, int]] = field(default_factory=list)
    gaps: int = 0
    missing: int = 0
    lost: int = 0
    ends: int | None = None

    def blocks(self, read: "Read", size: int) -> Iterator[bytes]:
        """The capture in blocks of `size` bytes, zeros where bytes are missing; the last one may be shorter."""
        block = b""
        for piece, before in self.ranges:
            for start, stop, data in ((0, before, bytes), (piece.start, piece.stop, None)):
                at = start
                while at < stop:
                    count = min(size - len(block), stop - at)
                    block += data(count) if data else read(at, at + count)
                    at += count
                    if len(block) == size:
                        yield block
                        block = b""
        yield block

    def warnings(self, name: str) -> list[str]:
        """What is missing, in a sentence, and what is left out."""
        if not self.gaps:
            return []
        places = f"{self.gaps} place{'s' * (self.gaps > 1)}"
        return [
            f"{name}: {self.missing} bytes or more are missing in {places}; the loops there are lost (zero, and "
            "marked), and what follows is moved to where it belongs"
        ]

    @property
    def size(self) -> int:
        """Bytes of all pieces and what is missing between them."""
        return sum(len(piece) + before for piece, before in self.ranges)


def read_range(files: Sequence[Path], start: int, stop: int) -> bytes:
    """Bytes start...stop-1 of files put end to end."""
    found = b""
    for path in files:
        size = path.stat().st_size
        if start < size and stop > 0:
            with explained(f"{path}: cannot be read", OSError), path.open("rb") as file:
                file.seek(max(start, 0))
                found += file.read(min(stop, size) - max(start, 0))
        start, stop = start - size, stop - size
    return found


class Judge:
    """Follows the loops of a capture from its beginning.

    Args:
        read: gives bytes of the capture.
        size: of the capture, bytes.
        config: of the radar; words lie in pairs.
        period: gives the period of samples from a byte on, if it plainly is not the configuration's.
    """

    def __init__(self, read: Read, size: int, config: RadarConfig, period: Callable[[int], int | None]):
        self._read, self._size, self._config, self._period = read, size, config, period
        self._loop = config.frame_bytes // config.loops
        self._usual = 0.0  # similarity of loops that follow each other

    def pieces(self) -> Pieces:
        """The whole capture as one piece, if nothing is wrong, or if nothing can be judged."""
        found, config = Pieces(), self._config
        begun = at = 0  # of the piece, and where it is looked at
        misfits: list[int] = []
        template: Loops | None = None
        if config.loops < 4 or not self._judges():
            return Pieces([(range(self._size), 0)])
        before = 0
        while at + self._loop * 2 <= self._size:
            done = (found.size + before + at - begun) // self._loop % config.loops
            loops = self._loops(at, min(config.loops - done, (self._size - at) // self._loop))
            gap = self._gap(at, loops, template)
            if gap is None:
                misfits = [] if self._fits(loops) else [*misfits, at]
                if len(misfits) == _MISFITS and self._period(misfits[0]) is not None:
                    found.ends = misfits[0]
                    break
                at, template = at + len(loops) * self._loop, loops[-1:]
                continue
            first, again = gap  # bytes
            found.ranges.append((range(begun, first), before))
            missing = (first - again) % self._loop
            extra = self._pause(again, (found.size + again - first + missing) // self._loop % config.loops)
            before = again - first + missing + extra * self._loop
            found.gaps, found.lost = found.gaps + 1, found.lost + again - first
            found.missing += missing + extra * self._loop
            begun, at, template, misfits = again, again, self._loops(again, 1), []
        found.ranges.append((range(begun, self._size if found.ends is None else found.ends), before))
        if found.gaps == 1 and found.ends is None:
            self._end_whole(found)
        return found

    def _end_whole(self, found: Pieces) -> None:
        """A capture ends with a whole frame: where whole loops, or nearly, are missing, the gap is longer."""
        rest = -found.size % self._config.frame_bytes
        nearly = (rest + _APART) % self._loop - _APART
        if abs(nearly) > _APART or nearly % _GROUP:
            return
        rest -= self._config.frame_bytes * (rest > self._config.frame_bytes - _APART)
        piece, before = found.ranges[-1]
        cut = self._loop - nearly if nearly else 0  # of the loop that would begin with some samples too few or many
        found.ranges[-1] = (range(piece.start + cut, piece.stop), before + rest + cut)
        found.missing, found.lost = found.missing + rest, found.lost + cut

    def _loops(self, start: int, count: int) -> Loops:
        """Loops from a byte on; I and Q in either order, for the other is the mirror image."""
        data = self._read(start, start + count * self._loop)
        words = np.frombuffer(data, "<i2", len(data) // self._loop * self._loop // 2)
        signal = _samples(words).reshape(-1, self._loop // 4 // self._config.samples, self._config.samples)
        return signal - signal.mean(axis=2, keepdims=True)

    def _judges(self) -> bool:
        """Whether loops are alike in the first frames."""
        found = [
            _alike(self._loops(k * self._config.frame_bytes, self._config.loops))
            for k in range(min(_ASKED, self._size // self._config.frame_bytes))
        ]
        self._usual = float(np.median(np.concatenate(found))) if found else 0.0
        return self._usual > _ALIKE

    def _fits(self, loops: Loops) -> bool:
        """Whether loops are about as alike as usual, or nothing."""
        alike = float(np.median(_alike(loops))) if len(loops) > 1 else 1.0
        return alike > _ALIKE * self._usual or not loops.any()

    def _gap(self, at: int, loops: Loops, template: Loops | None) -> tuple[int, int] | None:
        """Where bytes are missing among loops: the first byte that is lost, and the first one of a whole loop again."""
        alike, there = _alike(loops), np.abs(loops).max(axis=(1, 2)) > 0
        usual = max(float(np.median(alike)) if len(alike) else 0.0, _DIP * self._usual)
        dips = np.flatnonzero((alike < _DIP * usual) & there[1:] & there[:-1])  # zeros are lost packets
        for dip in dips[:2]:
            again = self._again(at + (int(dip) + 2) * self._loop, loops[dip : dip + 1], _LEAST)
            if again is not None:
                return at + int(dip) * self._loop, again
        if not len(dips) and template is not None and template.any() and there[0]:
            if float(_alike(np.concatenate([template, loops[:1]]))[0]) < _DIP * usual:
                again = self._again(at, template, _FOUND * self._usual)
                return None if again is None else (at, again)
        return None

    def _again(self, start: int, known: Loops, least: float) -> int | None:
        """The byte from which on loops are as a known one again, if that is not `start`: so alike at least."""
        data = np.frombuffer(self._read(start, start + 2 * self._loop + _GROUP), np.uint8)
        if len(data) < 2 * self._loop + _GROUP:
            return None
        scores = np.zeros((self._loop // _GROUP, _GROUP))
        for shift in range(_GROUP):
            words = np.frombuffer(data[shift : shift + 2 * self._loop].tobytes(), "<i2")
            scores[:, shift] = _likeness(_samples(words), known[0])[: 2 * len(scores) : 2]
        place = int(np.argmax(scores))
        best = float(scores.flat[place])
        near = min(place, self._loop - place) <= _APART and place % _GROUP == 0
        if near or best < max(least, _BETTER * scores[0, 0]):
            return None
        again = self._at_joints(start + place, known)
        return again if self._fits(self._loops(again, _ASKED)) else None

    def _at_joints(self, start: int, known: Loops) -> int:
        """The byte near another one from which on the joints between receivers are as in a known loop: beats that are
        shifted by some samples look much the same otherwise."""
        reach = range(-_NEAR, _NEAR + 1)
        places = [start + _GROUP * k for k in reach if 0 <= start + _GROUP * k <= self._size - self._loop]
        wanted = _joints(known)
        found = [np.abs((_joints(self._loops(place, 1)) * wanted.conj()).sum(axis=2)).sum() for place in places]
        return places[int(np.argmax(found))] if places else start

    def _pause(self, start: int, index: int) -> int:
        """Whole loops that are missing, too (or -1: one that is there twice), by where the pause between frames lies.

        Args:
            start: of a whole loop; index: of it within its frame, if none is missing.
        """
        count = min(self._config.loops * _FOLDED, (self._size - start) // self._loop) // self._config.loops
        if count < 2:
            return 0
        alike = _alike(self._loops(start, count * self._config.loops))
        folded = np.array([np.median(alike[k :: self._config.loops]) for k in range(self._config.loops)])
        last = int(np.argmin(folded))
        if folded[last] > _PAUSE * np.median(folded):
            return 0  # nothing moves
        extra = (self._config.loops - 1 - index - last) % self._config.loops
        return -1 if extra == self._config.loops - 1 else extra


def _samples(words: Int16[np.ndarray, "word"]) -> Complex64[np.ndarray, "sample"]:
    return np.ascontiguousarray(words.reshape(-1, 2, 2).swapaxes(1, 2), np.float32).view(np.complex64).reshape(-1)


def _likeness(
    signal: Complex64[np.ndarray, "long"], known: Complex64[np.ndarray, "channel sample"]
) -> Float[np.ndarray, "place"]:
    """How alike the loop that begins at each sample and a known one are, as `_alike` has it."""
    channels, length = known.shape
    places = len(signal) - channels * length + 1
    product = np.fft.ifft(np.fft.fft(signal) * np.fft.fft(known.reshape(-1), len(signal)).conj())[:places]
    power = np.concatenate([[0], np.cumsum(np.abs(signal.astype(complex)) ** 2)])
    total = np.concatenate([[0], np.cumsum(signal.astype(complex))])
    mean = np.abs(total[length:] - total[:-length]) ** 2 / length  # of each chirp, which is taken off
    offsets = sum(mean[k * length : k * length + places] for k in range(channels))
    own = power[channels * length :] - power[:places] - offsets
    return np.abs(product) / np.maximum(np.sqrt(np.maximum(own, 0)) * np.linalg.norm(known), 1e-9)


def _alike(loops: Loops) -> Float[np.ndarray, "pair"]:
    """How alike loops that follow each other are, 0 to 1, whatever the phase between them."""
    flat = loops.reshape(len(loops), -1)
    norm = np.linalg.norm(flat, axis=1)
    return np.abs((flat[1:] * flat[:-1].conj()).sum(axis=1)) / np.maximum(norm[1:] * norm[:-1], 1e-9)


def _joints(loops: Loops) -> Complex64[np.ndarray, "_ joint near"]:
    """Samples on both sides of where one receiver ends and the next begins, of unit power."""
    joints = np.concatenate([loops[:, :-1, -_JOINT:], loops[:, 1:, :_JOINT]], axis=2)
    return joints / np.maximum(np.linalg.norm(joints, axis=2, keepdims=True), 1e-9)
