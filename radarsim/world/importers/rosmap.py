"""Import of ROS maps: an image (.pgm, .png) and a .yaml with its metadata (map_server's format).

A pixel is occupied with probability p = (255 - value) / 255, or value / 255 if `negate`; above ``occupied_thresh`` it
counts as occupied, below ``free_thresh`` as free, between them as unknown. In mode ``raw`` the value is the occupancy
in percent. Row 0 is the top; ``origin`` is x, y, yaw of the lower left corner. http://wiki.ros.org/map_server
"""

from pathlib import Path

import numpy as np

from radarize.io.errors import InputError
from radarize.io.files import within
from radarize.io.pixels import read_picture
from radarize.io.yamlfile import read_yaml
from radarize.pipeline.runfolder.occupancy import MapFile
from radarsim.world.importers.occupancy import OccupancyGrid

#: Image modes that map_server reads and writes, by Pillow's names.
_FORMATS = ("PPM", "PNG", "BMP")
_FARTHEST = 500.0  # m, of a building


def is_map(path: Path) -> bool:
    """Whether a .yaml file is a map."""
    try:
        data = read_yaml(path)
    except InputError:
        return False
    return isinstance(data, dict) and "image" in data


def grid(path: Path) -> OccupancyGrid:
    """Read the map of a .yaml file, or of the .yaml beside an image.

    Raises:
        InputError: a file is missing or unreadable, or a key is, with its value.
    """
    if path.suffix.lower() not in (".yaml", ".yml"):
        beside = path.with_suffix(".yaml")
        if not beside.is_file():
            raise InputError(f"{path}: has no {beside.name} beside it, expected the map's resolution and origin there")
        path = beside
    about = MapFile.read(path)
    picture = within(path.parent / about.image, path, path.parent)
    value, values = read_picture(picture, str(picture), _FORMATS), np.arange(256)
    if max(value.shape) * about.resolution > _FARTHEST:
        raise InputError(
            f"{path}: resolution is {about.resolution:g} m for {value.shape[1]} x {value.shape[0]} pixels, expected a "
            f"building of at most {_FARTHEST:g} m"
        )
    if about.mode == "raw":
        known, share = values <= 100, values / 100
    else:
        known, share = np.ones(256, bool), (values if about.negate else 255 - values) / 255
    occupied, free = (known & (share > about.occupied_thresh))[value], (known & (share < about.free_thresh))[value]
    # Rows run downwards from the top, cells upwards from the origin.
    return OccupancyGrid(occupied[::-1].T.copy(), free[::-1].T.copy(), about.resolution, about.origin)
