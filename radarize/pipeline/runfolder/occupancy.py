"""ROS maps: an image (.pgm) and its description (.yaml), as in http://wiki.ros.org/map_server.

A pixel is occupied with probability p = (255 - value) / 255, or value / 255 if `negate`; above ``occupied_thresh`` it
counts as occupied, below ``free_thresh`` as free, between them as unknown. Row 0 is the top; ``origin`` is x, y, yaw of
the lower left corner.
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
import yaml
from jaxtyping import Bool, Float, UInt8
from pydantic import BaseModel, Field, ValidationError

from radarize.io.canvas import axes_or_new, png
from radarize.io.errors import InputError
from radarize.io.files import read_bytes
from radarize.io.pixels import MOST_PIXELS
from radarize.io.plain import format_validation_error
from radarize.io.pose import transform
from radarize.io.replacing import replacing
from radarize.io.yamlfile import read_yaml
from radarize.slam.grid import OccupancyGrid

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Number = Annotated[float, Field(allow_inf_nan=False)]
#: Maximum bytes of a description, and of an image's header with its comments.
_DESCRIPTION, _HEADER = 16 << 10, 4 << 10
_PICTURE = MOST_PIXELS + _HEADER
#: Header of an 8-bit PGM: width and height, with comments between them, and one space before the pixels.
_PGM = re.compile(rb"P5~(\d{1,9})~(\d{1,9})~255\s".replace(b"~", rb"(?:\s|#[^\n]*\n)+"))


class MapFile(BaseModel):
    """Keys of a map's .yaml; others are ignored."""

    image: str
    resolution: Annotated[float, Field(gt=0, le=1)]
    origin: tuple[Number, Number, Number]
    negate: Annotated[int, Field(ge=0, le=1)] = 0
    occupied_thresh: Annotated[float, Field(ge=0, le=1)] = 0.65
    free_thresh: Annotated[float, Field(ge=0, le=1)] = 0.196
    mode: Literal["trinary", "scale", "raw"] = "trinary"

    @classmethod
    def read(cls, path: Path) -> "MapFile":
        """Read the description from a file.

        Raises:
            InputError: the file is missing or unreadable, or a key is missing or has a wrong value.
        """
        try:
            return cls.model_validate(read_yaml(path, _DESCRIPTION))
        except ValidationError as error:
            raise InputError(f"{path}: {format_validation_error(error)}") from error


@dataclass(frozen=True)
class OccupancyMap:
    """An occupancy map as stored in its files.

    Attributes:
        about: description (resolution, origin, thresholds).
        pixels: grey values, first row at the top (largest y).
    """

    about: MapFile
    pixels: UInt8[np.ndarray, "row column"]

    @classmethod
    def read(cls, description: Path) -> "OccupancyMap":
        """Read a map from its ``.yaml`` and the image beside it.

        Raises:
            InputError: a file is missing or malformed; names file and field.
        """
        about = MapFile.read(description)
        if Path(about.image).name != about.image:
            raise InputError(f"{description}: image is {about.image!r}, expected the name of a file beside it")
        return cls(about, read_pgm(description.parent / about.image))

    @classmethod
    def of(cls, grid: OccupancyGrid) -> "OccupancyMap":
        """Return the map of a SLAM grid, to be saved."""
        origin = (*grid.origin.round(6).tolist(), 0.0)
        return cls(MapFile(image="map.pgm", resolution=grid.resolution, origin=origin), grid.image())

    @property
    def resolution(self) -> float:
        """Side of a cell, m."""
        return self.about.resolution

    @property
    def origin(self) -> tuple[float, float, float]:
        """Pose (x, y, yaw) of the lower left corner in the map's frame, m and rad."""
        return self.about.origin

    @property
    def occupied(self) -> Bool[np.ndarray, "row column"]:
        """Cells that count as occupied."""
        return (self._chances > self.about.occupied_thresh)[self.pixels]

    @property
    def free(self) -> Bool[np.ndarray, "row column"]:
        """Cells that count as free."""
        return (self._chances < self.about.free_thresh)[self.pixels]

    @property
    def _chances(self) -> Float[np.ndarray, "256"]:
        """Probability that a cell is occupied, by its grey value."""
        values = np.arange(256.0)
        return (values if self.about.negate else 255 - values) / 255

    def centers(self, cells: Bool[np.ndarray, "row column"]) -> Float[np.ndarray, "cell 2"]:
        """Return the centres of the chosen cells in the map's frame, m."""
        row, column = np.nonzero(cells)
        inside = np.column_stack([column + 0.5, len(self.pixels) - row - 0.5]) * self.resolution
        return transform(np.array(self.origin), inside)

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draw the map, in m on its own axes (`origin` without the yaw)."""
        axes = axes_or_new(axes)
        (left, low, _), (rows, columns) = self.origin, self.pixels.shape
        extent = (left, left + columns * self.resolution, low, low + rows * self.resolution)
        axes.imshow(self.pixels, cmap="gray", vmin=0, vmax=255, extent=extent)
        axes.set(xlabel="x, m", ylabel="y, m")
        return axes

    def _repr_png_(self) -> bytes:
        return png(self.plot)

    def save(self, description: Path) -> Path:
        """Write the map as ``NAME.yaml`` and ``NAME.pgm``, as ROS map_server reads them.

        Raises:
            InputError: a file cannot be written.
        """
        image = description.with_suffix(".pgm")
        with replacing(image) as part:
            part.write_bytes(b"P5\n%d %d\n255\n" % self.pixels.shape[::-1] + self.pixels.tobytes())
        with replacing(description) as part:
            fields = self.about.model_dump() | {"image": image.name, "origin": list(self.origin)}
            part.write_text(yaml.safe_dump(fields, sort_keys=False, default_flow_style=None))
        return description


def read_pgm(path: Path) -> UInt8[np.ndarray, "row column"]:
    """Read the pixels of a binary 8-bit PGM (``P5``).

    Raises:
        InputError: not such a file, or cut short.
    """
    content = read_bytes(path, "a map's picture (.pgm)", _PICTURE)
    head = _PGM.match(content, 0, _HEADER)
    if not head:
        raise InputError(f"{path}: starts with {content[:20]!r}, expected an 8-bit binary PGM (P5)")
    width, height = map(int, head.groups())
    found = len(content) - head.end()
    if found < width * height:
        raise InputError(f"{path}: holds {found} pixels, expected {width} x {height}")
    return np.frombuffer(content, np.uint8, width * height, head.end()).reshape(height, width)
