"""Missing bytes within a raw capture, and a change of the frame size.

A capture has words only, so lost bytes shift everything after them. Chirps of one transmitter and receiver are similar
from loop to loop: where a loop differs from the one before, the next bytes are searched for the place from which on
    loops
are similar to it again. The bytes between are lost, in whole loops.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Complex64, Float, Int16

from radarize.io.errors import explained
from radarize.radar.config import RadarConfig

#: Similarity of consecutive loops from which on a capture can be judged, number of frames examined for it, and share of
#: the usual similarity below which a loop is examined.
_SIMILAR, _ASKED, _DIP = 0.5, 4, 0.7
#: Another place is accepted if its similarity is at least this, and this ratio to that of the current place; across the
#: pause between frames, where much changes, at least this share of the usual similarity.
_LEAST, _BETTER, _FOUND = 0.4, 1.5, 0.85
#: Minimum bytes by which a place must differ if by whole groups: after some samples, beats of moving scenes are
#: similar.
_APART = 128
#: Groups of two samples around a place in which the joints between receivers are searched, and samples on either side.
_NEAR, _JOINT = 12, 6
#: Frames after a gap in which the pause between frames is searched, and ratio of similarity across it to the usual one.
_FOLDED, _PAUSE = 6, 0.8
#: Consecutive frames that do not fit, after which a capture ends if its samples have another period from there on.
_MISFITS = 4
#: Bytes of I and Q of two samples.
_GROUP = 8

Loops = Complex64[np.ndarray, "_ channel sample"]
Read = Callable[[int, int], bytes]


@dataclass
class Pieces:
    """A capture as pieces of its files.

    Attributes:
        ranges: byte ranges of the concatenated files, each with the number of bytes missing before it.
        gaps, missing: number of gaps, and minimum number of missing bytes; whole loops may be missing unnoticed.
        lost: received bytes of incomplete loops.
        ends: byte from which on frames have another size; None if none have.
    """

    ranges: list[tuple[range, int]] = field(default_factory=list)
    gaps: int = 0
    missing: int = 0
    lost: int = 0
    ends: int | None = None

    def blocks(self, read: "Read", size: int) -> Iterator[bytes]:
        """Yield the capture in blocks of `size` bytes, with zeros for missing bytes; the last one may be shorter."""
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
        """Return a sentence on what is missing and left out."""
        if not self.gaps:
            return []
        places = f"{self.gaps} place{'s' * (self.gaps > 1)}"
        return [
            f"{name}: {self.missing} bytes or more are missing in {places}; the loops there are lost (zero, and "
            "marked), and the following ones are moved to their correct place"
        ]

    @property
    def size(self) -> int:
        """Bytes of all pieces, including the missing bytes between them."""
        return sum(len(piece) + before for piece, before in self.ranges)


def read_range(files: Sequence[Path], start: int, stop: int) -> bytes:
    """Return bytes start to stop - 1 of concatenated files."""
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
    """Checks the loops of a capture one after another for missing bytes.

    Args:
        read: returns bytes start to stop - 1 of the capture.
        size: size of the capture, bytes.
        config: radar configuration; words are in pairs.
        period: returns the period of the samples from a byte on, if it differs from the configured one.
    """

    def __init__(self, read: Read, size: int, config: RadarConfig, period: Callable[[int], int | None]):
        self._read, self._size, self._config, self._period = read, size, config, period
        self._loop = config.frame_bytes // config.loops
        self._usual = 0.0  # similarity of consecutive loops

    def pieces(self) -> Pieces:
        """Return the pieces of the capture; a single one if no byte is missing or the loops cannot be judged."""
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
        """Extend a single gap such that the capture ends with a whole frame, if about whole loops are missing."""
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
        """Return loops from a byte on; the order of I and Q does not matter, since the other one gives the mirror
        image."""
        data = self._read(start, start + count * self._loop)
        words = np.frombuffer(data, "<i2", len(data) // self._loop * self._loop // 2)
        signal = _samples(words).reshape(-1, self._loop // 4 // self._config.samples, self._config.samples)
        return signal - signal.mean(axis=2, keepdims=True)

    def _judges(self) -> bool:
        """Return whether loops are similar in the first frames."""
        found = [
            _similarity(self._loops(k * self._config.frame_bytes, self._config.loops))
            for k in range(min(_ASKED, self._size // self._config.frame_bytes))
        ]
        self._usual = float(np.median(np.concatenate(found))) if found else 0.0
        return self._usual > _SIMILAR

    def _fits(self, loops: Loops) -> bool:
        """Return whether loops are about as similar as usual, or zero."""
        similarity = float(np.median(_similarity(loops))) if len(loops) > 1 else 1.0
        return similarity > _SIMILAR * self._usual or not loops.any()

    def _gap(self, at: int, loops: Loops, template: Loops | None) -> tuple[int, int] | None:
        """Return the first lost byte among loops, and the first byte of a whole loop after it; None without a gap."""
        similarity, present = _similarity(loops), np.abs(loops).max(axis=(1, 2)) > 0
        usual = max(float(np.median(similarity)) if len(similarity) else 0.0, _DIP * self._usual)
        dips = np.flatnonzero((similarity < _DIP * usual) & present[1:] & present[:-1])  # zeros are lost packets
        for dip in dips[:2]:
            again = self._again(at + (int(dip) + 2) * self._loop, loops[dip : dip + 1], _LEAST)
            if again is not None:
                return at + int(dip) * self._loop, again
        if not len(dips) and template is not None and template.any() and present[0]:
            if float(_similarity(np.concatenate([template, loops[:1]]))[0]) < _DIP * usual:
                again = self._again(at, template, _FOUND * self._usual)
                return None if again is None else (at, again)
        return None

    def _again(self, start: int, known: Loops, least: float) -> int | None:
        """Return the byte from which on loops are similar to a known one again; None if that is `start` or none is
        found."""
        data = np.frombuffer(self._read(start, start + 2 * self._loop + _GROUP), np.uint8)
        if len(data) < 2 * self._loop + _GROUP:
            return None
        scores = np.zeros((self._loop // _GROUP, _GROUP))
        for shift in range(_GROUP):
            words = np.frombuffer(data[shift : shift + 2 * self._loop].tobytes(), "<i2")
            scores[:, shift] = _similarity_at(_samples(words), known[0])[: 2 * len(scores) : 2]
        place = int(np.argmax(scores))
        best = float(scores.flat[place])
        near = min(place, self._loop - place) <= _APART and place % _GROUP == 0
        if near or best < max(least, _BETTER * scores[0, 0]):
            return None
        again = self._at_joints(start + place, known)
        return again if self._fits(self._loops(again, _ASKED)) else None

    def _at_joints(self, start: int, known: Loops) -> int:
        """Return the byte near another one from which on the joints between receivers are as in a known loop. Elsewhere
        in a loop, beats shifted by some samples are similar."""
        reach = range(-_NEAR, _NEAR + 1)
        places = [start + _GROUP * k for k in reach if 0 <= start + _GROUP * k <= self._size - self._loop]
        wanted = _joints(known)
        found = [np.abs((_joints(self._loops(place, 1)) * wanted.conj()).sum(axis=2)).sum() for place in places]
        return places[int(np.argmax(found))] if places else start

    def _pause(self, start: int, index: int) -> int:
        """Return the number of further missing whole loops (-1: one is repeated), from the pause between frames.

        Args:
            start: first byte of a whole loop; index: its index within the frame, if none is missing.
        """
        count = min(self._config.loops * _FOLDED, (self._size - start) // self._loop) // self._config.loops
        if count < 2:
            return 0
        similarity = _similarity(self._loops(start, count * self._config.loops))
        folded = np.array([np.median(similarity[k :: self._config.loops]) for k in range(self._config.loops)])
        last = int(np.argmin(folded))
        if folded[last] > _PAUSE * np.median(folded):
            return 0  # no motion
        extra = (self._config.loops - 1 - index - last) % self._config.loops
        return -1 if extra == self._config.loops - 1 else extra


def _samples(words: Int16[np.ndarray, "word"]) -> Complex64[np.ndarray, "sample"]:
    return np.ascontiguousarray(words.reshape(-1, 2, 2).swapaxes(1, 2), np.float32).view(np.complex64).reshape(-1)


def _similarity_at(
    signal: Complex64[np.ndarray, "long"], known: Complex64[np.ndarray, "channel sample"]
) -> Float[np.ndarray, "place"]:
    """Return the `_similarity` of a known loop and the loop that begins at each sample."""
    channels, length = known.shape
    places = len(signal) - channels * length + 1
    product = np.fft.ifft(np.fft.fft(signal) * np.fft.fft(known.reshape(-1), len(signal)).conj())[:places]
    power = np.concatenate([[0], np.cumsum(np.abs(signal.astype(complex)) ** 2)])
    total = np.concatenate([[0], np.cumsum(signal.astype(complex))])
    mean = np.abs(total[length:] - total[:-length]) ** 2 / length  # mean of each chirp, subtracted
    offsets = sum(mean[k * length : k * length + places] for k in range(channels))
    own = power[channels * length :] - power[:places] - offsets
    return np.abs(product) / np.maximum(np.sqrt(np.maximum(own, 0)) * np.linalg.norm(known), 1e-9)


def _similarity(loops: Loops) -> Float[np.ndarray, "pair"]:
    """Return the similarity of consecutive loops, 0 to 1, independent of the phase between them."""
    flat = loops.reshape(len(loops), -1)
    norm = np.linalg.norm(flat, axis=1)
    return np.abs((flat[1:] * flat[:-1].conj()).sum(axis=1)) / np.maximum(norm[1:] * norm[:-1], 1e-9)


def _joints(loops: Loops) -> Complex64[np.ndarray, "_ joint near"]:
    """Return the samples on both sides of each boundary between receivers, of unit power."""
    joints = np.concatenate([loops[:, :-1, -_JOINT:], loops[:, 1:, :_JOINT]], axis=2)
    return joints / np.maximum(np.linalg.norm(joints, axis=2, keepdims=True), 1e-9)
