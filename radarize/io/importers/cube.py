"""Import of raw samples as an array with axes in any order: ``.npy``, ``.npz`` and ``.mat``."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Complex, Int16

from radarize.io.errors import InputError
from radarize.io.importers.arrays import ArrayFile, open_array
from radarize.io.importers.bin import configured
from radarize.io.importers.capture import Capture, CapturedFrames, batch_frames
from radarize.io.importers.format import Format
from radarize.io.importers.parameters import Given
from radarize.radar.config import RadarConfig

#: Text of an axis length.
_LENGTH = re.compile(r"[0-9]{1,9}")
#: Axes of a recording's samples; complex entries have no axis ``iq``.
STANDARD = ("frame", "loop", "tx", "rx", "sample", "iq")
#: Further names of axes, and the axes that they combine, the last one varying fastest. `slot` is the transmitter in
#: firing order, `tx` in physical order; `qi` has the imaginary part first.
JOINED = {"chirp": ("loop", "slot"), "virtual": ("tx", "rx")}
#: Names of axes in another order, and of the same axes in standard order.
_OTHER_ORDER = {"slot": "tx", "qi": "iq"}
#: ADC counts to which the maximum of samples without a unit is scaled: 12 dB below full scale.
_PEAK = 8192


@dataclass(frozen=True)
class ArrayAxes:
    """Meaning of the axes of an array.

    Attributes:
        names: names of the array's axes in order, out of `STANDARD`, `JOINED`, ``slot`` and ``qi``.
    """

    names: tuple[str, ...]

    @classmethod
    def parse(cls, text: str, array: ArrayFile) -> "ArrayAxes":
        """Parse names of axes (``frame,loop,virtual,sample``), or lengths for `STANDARD` in order (``9,32,3,4,96``).

        Raises:
            InputError: an unknown or ambiguous name, or another number of axes than the array has.
        """
        words = [word.strip() for word in text.split(",")]
        if all(_LENGTH.fullmatch(word) for word in words) and len(words) in (5, 6):
            array.reshaped(tuple(int(word) for word in words))
            return cls(STANDARD[: len(words)])
        known = (*STANDARD, *JOINED, *_OTHER_ORDER)
        parts = [part for word in words for part in JOINED.get(word, (word,))]
        parts = [_OTHER_ORDER.get(part, part) for part in parts]
        if not set(words) <= set(known) or len(set(parts)) != len(parts) or "sample" not in parts:
            raise InputError(
                f"shape is {text!r}, expected names of axes, each once ({', '.join(known)}), or five or six lengths"
            )
        if len(words) != len(array.shape):
            raise InputError(f"{array.name}: has shape {array.shape}, expected {len(words)} axes for {text!r}")
        return cls(tuple(words))

    @classmethod
    def guess(cls, array: ArrayFile) -> "ArrayAxes":
        """Return the axes of a recording, if the array has as many.

        Raises:
            InputError: the array has another number of axes.
        """
        expected = 5 if array.dtype.kind == "c" else 6
        if len(array.shape) != expected:
            raise InputError(
                f"{array.name}: has shape {array.shape}, expected the option shape to name its axes, such as "
                "frame,loop,virtual,sample"
            )
        return cls(STANDARD[:expected])

    def lengths(self, array: ArrayFile, given: dict[str, int | None]) -> dict[str, int]:
        """Return lengths of frame, loop, tx, rx and sample; `given` has the numbers of antennas on combined axes.

        Raises:
            InputError: the lengths are not determined, or the array does not have I and Q.
        """
        found = {_OTHER_ORDER.get(name, name): n for name, n in zip(self.names, array.shape, strict=True)}
        for name, (outer, inner) in JOINED.items():
            if name not in found:
                continue
            length, outer, inner = found.pop(name), outer, "tx" if inner == "slot" else inner
            known = inner if given.get(inner) else outer if given.get(outer) else None
            if known is None:
                raise InputError(f"{array.name}: has {length} entries on axis {name}, expected {inner} to be given")
            count = given[known]
            assert count is not None  # it is one of the known ones
            if length % count:
                raise InputError(f"{array.name}: has {length} entries on axis {name}, expected a multiple of {count}")
            found[known], found[outer if known == inner else inner] = count, length // count
        if (found.get("iq", 2) != 2) or ("iq" in found) == (array.dtype.kind == "c"):
            raise InputError(
                f"{array.name}: holds {array.dtype} of shape {array.shape}, expected complex samples, or real ones "
                "with an axis iq of 2"
            )
        return {name: found.get(name, 1) for name in STANDARD[:5]}

    def standard(self, block: np.ndarray, config: RadarConfig) -> Complex[np.ndarray, "frame loop tx rx sample"]:
        """Return some frames as complex samples on the axes of a recording."""
        loops, tx, rx, samples, _ = config.frame_shape
        sizes = {"loop": loops, "slot": tx, "tx": tx, "rx": rx, "sample": samples, "iq": 2, "qi": 2}
        names = [part for name in self.names for part in JOINED.get(name, (name,))]
        sizes["frame"] = block.size // math.prod(sizes[name] for name in names if name != "frame")
        block = block.reshape([sizes[name] for name in names])
        fired, reversed_ = "slot" in names, "qi" in names
        names = [_OTHER_ORDER.get(name, name) for name in names]
        wanted = [name for name in STANDARD if name in names]
        block = block.transpose([names.index(name) for name in wanted])
        if wanted[-1] == "iq":
            block = block[..., int(reversed_)] + 1j * block[..., 1 - reversed_].astype(np.float64)
        block = np.expand_dims(block, [k for k, name in enumerate(STANDARD[:5]) if name not in wanted])
        return block[:, :, list(config.slot)] if fired else block


def open_cube(path: Path, given: Given, folder: Path) -> Capture:
    """Open an array of samples: ADC counts, or any other unit, which is scaled to counts.

    Args:
        path: the file.
        given: settings of the radar (lengths of axes may be missing), name of the array, and its axes (by default those
            of a recording).
        folder: folder for unpacking a compressed array.

    Raises:
        InputError: not such a file, or its shape does not fit the configuration.
    """
    array = open_array(path, given.variable, folder)
    axes = ArrayAxes.parse(given.shape, array) if given.shape else ArrayAxes.guess(array)
    known = given.config.model_dump() | {"tx": given.config.tx} if given.config else {}
    known |= {name: value for name, value in given.overrides.items() if value}
    counts = {name: len(value) if isinstance(value, tuple) else value for name, value in known.items()}
    lengths = axes.lengths(array, {"loop": counts.get("loops"), "tx": counts.get("tx"), "rx": counts.get("rx")})
    found = {"samples": lengths["sample"], "loops": lengths["loop"], "rx": lengths["rx"], "tx": lengths["tx"]}
    config, assumed = given.configure(str(path), found)
    expected = dict(zip(STANDARD[1:5], config.frame_shape, strict=False))
    if wrong := [name for name in expected if expected[name] != lengths[name]]:
        raise InputError(
            f"{array.name}: has {', '.join(f'{name} {lengths[name]}' for name in wrong)} (shape {array.shape}), "
            f"expected {', '.join(f'{name} {expected[name]}' for name in wrong)} from the radar's configuration"
        )
    if not lengths["frame"]:
        raise InputError(f"{array.name}: has shape {array.shape}, expected at least one frame")
    capture = Capture(config, given.cfg_text, (), lengths["frame"], assumed)
    capture.batches = _batches(array, axes, capture)
    return capture


def _batches(array: ArrayFile, axes: ArrayAxes, capture: Capture) -> Iterator[CapturedFrames]:
    config, scale, clipped = capture.config, None, 0
    size = batch_frames(config)
    for start in range(0, capture.expected_frames, size):
        stop = min(start + size, capture.expected_frames)
        if "frame" in axes.names:
            block = array.take(axes.names.index("frame"), start, stop)
        else:
            block = array.take(0, 0, array.shape[0])
        values = axes.standard(block, config)
        known = np.isfinite(values)
        values = np.stack([values.real, values.imag], axis=-1)
        values[~known] = 0
        if scale is None:
            scale = _counts_per_unit(values)
            if scale != 1:
                capture.attributes["counts_per_unit"] = scale
        frames, lost = _counts(values, scale)
        clipped += lost
        yield CapturedFrames(frames, frames.any(axis=(3, 4, 5)) & known.all(axis=(3, 4)))
    if clipped:
        capture.warnings.append(f"{clipped} values exceed 16 bits and are clipped")


def _counts_per_unit(values: np.ndarray) -> float:
    """Return 1 for integers; else the factor that scales the maximum of the first frames to a quarter of full scale."""
    if (values == np.rint(values)).all():
        return 1.0
    return float(_PEAK / np.abs(values).max())


def _counts(values: np.ndarray, scale: float) -> tuple[Int16[np.ndarray, "frame loop tx rx sample 2"], int]:
    """Return samples as 16-bit counts, and the number of clipped ones."""
    counts = np.rint(values * scale)
    if counts.min(initial=0) >= 0 and counts.max(initial=0) > np.iinfo(np.int16).max:
        # Signed words that a capture program wrote as unsigned ones.
        counts = np.where(counts > np.iinfo(np.int16).max, counts - 2**16, counts)
    inside = np.clip(counts, -(2**15), 2**15 - 1)
    return inside.astype(np.int16), int(np.count_nonzero(inside != counts))


FORMAT = Format(
    "array",
    "an array (.npy, .npz, .mat)",
    lambda source: source.suffix.lower() in (".npy", ".npz", ".mat"),
    lambda source, given, folder: open_cube(source, configured(source, given), folder),
    options=("shape", "variable"),
)
