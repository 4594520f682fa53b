"""ROS maps: a picture (.pgm, .png) and the .yaml that says what it means (map_server's format).

A pixel is occupied with probability p = (255 - value) / 255, or value / 255 if `negate`; above ``occupied_thresh`` it
counts as occupied, below ``free_thresh`` as free, between them as unknown. In mode ``raw`` the value is the occupancy
in percent. Row 0 is the top; ``origin`` is x, y, yaw of the lower left corner. http://wiki.ros.org/map_server
"""

from pathlib import Path

import numpy as np
from PIL import Image

from radarize.errors import InputError
from radarize.runfolder.occupancy import MapFile
from radarize.yamlfile import read_yaml
from radarsim.scene.importers.grid import OccupancyGrid


def is_map(path: Path) -> bool:
    """Whether a .yaml file is a map's rather than anything else."""
    try:
        data = read_yaml(path)
    except InputError:
        return False
    return isinstance(data, dict) and "image" in data


def grid(path: Path) -> OccupancyGrid:
    """The map of a .yaml file, or of the .yaml beside a picture.

    Raises:
        InputError: a file is missing or unreadable, or a key is, with its value.
    """
    if path.suffix.lower() not in (".yaml", ".yml"):
        beside = path.with_suffix(".yaml")
        if not beside.is_file():
            raise InputError(f"{path}: has no {beside.name} beside it, expected the map's resolution and origin there")
        path = beside
    about = MapFile.read(path)
    picture = path.parent / about.image
    try:
        with Image.open(picture) as image:
            value = np.asarray(image.convert("L"), float)
    except FileNotFoundError:
        raise InputError(f"{path}: image {about.image} does not exist") from None
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise InputError(f"{picture}: is not a readable picture ({error})") from error
    if about.mode == "raw":
        known, share = value <= 100, value / 100
    else:
        known, share = True, (value if about.negate else 255 - value) / 255
    occupied, free = known & (share > about.occupied_thresh), known & (share < about.free_thresh)
    # Rows run downwards from the top, cells upwards from the origin.
    return OccupancyGrid(occupied[::-1].T.copy(), free[::-1].T.copy(), about.resolution, about.origin)
