"""A hall with a person in it, a small radar, and data sets of walks through it."""

from pathlib import Path

import yaml

from radarize.radar.cfg import write_cfg
from radarize.radar.presets import PRESETS
from radarsim.dataset.specification import Specification

#: Two frames a second: few see much of a walk, and a recording reaches the disk with every second one.
CONFIG = PRESETS["radarize"].model_copy(update={"loops": 16, "frame_period": 0.5})
#: Level 1 has a crate beside the straight way.
HALL = """
objects:
  - {name: floor, shape: rectangle, size: [6, 4], position: [3, 2, 0], facing: [0, 0, 1], material: vinyl}
  - {name: wall, shape: rectangle, size: [4, 2.5], position: [6, 2, 1.25], facing: [-1, 0, 0], material: wood}
  - {name: side, shape: rectangle, size: [6, 2.5], position: [3, 4, 1.25], facing: [0, -1, 0], material: concrete}
  - {name: pipe, shape: cylinder, radius: 0.05, height: 2, position: [5.5, 3.3, 1], material: metal}
moving:
  - {kind: person, name: visitor, path: [[3, 1], [5, 1.2]], speed: 1.2}
levels:
  - objects: [{name: crate, shape: box, size: [0.5, 0.5, 2], position: [2.2, 2.9, 1.01], material: metal}]
"""
WAY = [[1, 2.4], [5, 2.4]]


def recordings(platform: str | list[str] = "cart", duration: float = 3.0, way: list = WAY) -> list[dict]:
    """Recordings of a specification: one walk along the hall for each platform."""
    return [{"building": "hall", "platform": platform, "count": 1, "duration": duration, "waypoints": way}]


def write(folder: Path, **changes) -> Path:
    """Write a specification of recordings in the hall, and its files."""
    (folder / "hall.yaml").write_text(HALL)
    (folder / "small.cfg").write_text(write_cfg(CONFIG))
    plain = {"name": "tiny", "seed": 1, "buildings": {"hall": "hall.yaml"}, "radar": "small.cfg", "randomise": {}}
    path = folder / "tiny.yaml"
    path.write_text(yaml.safe_dump(plain | {"recordings": recordings()} | changes))
    return path


def specification(folder: Path, **changes) -> Specification:
    """Write the specification and read it."""
    return Specification.load(write(folder, **changes))
