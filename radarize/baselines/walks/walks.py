"""Reader of the real walks of RadarHD's repository: pictures of a radar and of a lidar on the same rig.

Prabhakara et al., "High resolution point clouds from mmWave radar", ICRA 2023. The repository has no licence: users may
evaluate on a clone of their own and cite the paper; this project contains none of its data.

    dataset_5/train|test/radar/R_WALK_FRAME.png      256 x 64, see `radarize.signal.polar`
    dataset_5/train|test/lidar/L_WALK_FRAME.png      256 x 512
"""

import io
import lzma
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from radarize.io.errors import InputError, explained
from radarize.io.files import read_bytes
from radarize.io.npyfile import read_npz
from radarize.io.pixels import read_picture
from radarize.radar.presets import PRESETS
from radarize.signal import polar

#: Time between frames, s.
PERIOD = PRESETS["radarhd"].frame_period
#: First frame that is evaluated, as by the authors, whose network reads the frames before it.
FIRST = 40
#: Maximum size of another program's points of a walk, packed or unpacked, bytes.
_LARGEST = 256 << 20


@dataclass(frozen=True)
class Walk:
    """A real walk in a clone of the repository.

    Attributes:
        folder: folder ``train`` or ``test`` of the data set.
        number: number of the walk.
        frames: number of frames.
    """

    folder: Path
    number: int
    frames: int

    @classmethod
    def find(cls, data: Path, number: int) -> "Walk":
        """Find a walk by its number in the data set of a clone.

        Raises:
            InputError: no such walk, or pictures are missing.
        """
        for part in ("train", "test"):
            folder = Path(data) / part
            names = {int(path.stem.split("_")[2]) for path in folder.glob(f"radar/R_{number}_*.png")}
            if names:
                if missing := sorted(set(range(max(names) + 1)) - names):
                    raise InputError(
                        f"{folder / 'radar' / f'R_{number}_{missing[0]}.png'}: is missing, expected a picture"
                    )
                return cls(folder, number, len(names))
        raise InputError(f"{data}: has no walk {number}, expected train|test/radar/R_{number}_0.png and so on")

    @classmethod
    def tests(cls, data: Path) -> "list[Walk]":
        """Return all test walks.

        Raises:
            InputError: no test walks, or pictures are missing.
        """
        numbers = {path.stem.split("_")[1] for path in Path(data).glob("test/radar/R_*_*.png")}
        if not numbers:
            raise InputError(
                f"{data}: holds no test/radar/R_WALK_FRAME.png, expected the data set of RadarHD's repository"
            )
        return [cls.find(data, int(number)) for number in sorted(numbers, key=int)]

    def radar(self, frame: int) -> UInt8[np.ndarray, "range azimuth"]:
        """Read the radar's picture of a frame, 0...255.

        Raises:
            InputError: missing, damaged, or of another size.
        """
        return _picture(self.folder / "radar" / f"R_{self.number}_{frame}.png", (polar.ROWS, polar.COLUMNS))

    def lidar(self, frame: int) -> Bool[np.ndarray, "range azimuth"]:
        """Read the cells of a frame in which the lidar has points.

        Raises:
            InputError: missing, damaged, or of another size.
        """
        return _picture(self.folder / "lidar" / f"L_{self.number}_{frame}.png", (polar.ROWS, polar.BEAMS)) > 0

    def batches(self, size: int = 16) -> Iterator[tuple[slice, UInt8[np.ndarray, "frame range azimuth"]]]:
        """Read the radar's pictures in batches: frames, pictures."""
        for start in range(0, self.frames, size):
            stop = min(start + size, self.frames)
            yield slice(start, stop), np.stack([self.radar(frame) for frame in range(start, stop)])


def _picture(path: Path, shape: tuple[int, int]) -> np.ndarray:
    found = read_picture(path, str(path))
    if found.shape != shape:
        raise InputError(f"{path}: is {found.shape[0]} x {found.shape[1]}, expected {shape[0]} x {shape[1]} pixels")
    return found


@dataclass(frozen=True)
class Predictions:
    """Point clouds that another program estimated on the walks.

    Attributes:
        folder: folder of ``WALK.npz`` or ``WALK.npz.xz`` (``prediction``: packed bits of each frame on the grid
            `radarize.signal.polar.GRID`; ``frame``: frame indices), or of pictures ``...WALK_FRAME.png`` in the format
            of the lidar's pictures.
    """

    folder: Path

    def points(self, walk: Walk) -> dict[int, Float[np.ndarray, "point 2"]]:
        """Return points (x forward, y left, m) by frame index; empty for a walk without predictions.

        Raises:
            InputError: a damaged file.
        """
        for path in (self.folder / f"{walk.number}.npz", self.folder / f"{walk.number}.npz.xz"):
            if path.is_file():
                frames, bits = _packed(path)
                unpacked = (np.unpackbits(each, axis=-1) for each in bits)
                return {int(k): polar.on_grid(np.nonzero(each)) for k, each in zip(frames, unpacked, strict=True)}
        pictures = {}
        for path in self.folder.glob(f"*{walk.number}_*.png"):
            words = path.stem.removesuffix("_pred").split("_")
            if len(words) >= 2 and words[-2] == str(walk.number) and words[-1].isdecimal():
                pictures[int(words[-1])] = polar.cartesian(_picture(path, (polar.ROWS, polar.BEAMS)) > 127)
        return pictures


def _packed(path: Path) -> tuple[Int[np.ndarray, "frame"], UInt8[np.ndarray, "frame x byte"]]:
    content = read_bytes(path, "packed points", _LARGEST)
    with explained(f"{path}: is damaged, expected packed bits `prediction` and numbers `frame`"):
        if path.suffix == ".xz":
            packed = lzma.LZMADecompressor(memlimit=_LARGEST)
            content = packed.decompress(content, _LARGEST)
            if not packed.eof:
                raise ValueError(f"cut short, or more than {_LARGEST} bytes")
        arrays = read_npz(io.BytesIO(content), str(path), ("frame", "prediction"), len(content))
        frames, bits = arrays["frame"], arrays["prediction"]
        if bits.dtype != np.uint8 or bits.shape != (len(frames), len(polar.GRID[0]), len(polar.GRID[1]) // 8):
            raise ValueError(f"prediction is {bits.dtype} of shape {bits.shape}")
    return frames, bits
