"""Small objects down to 2 cm on the tops, walls and ceilings of a scene (`small_objects.yaml`).

Smaller objects are point scatterers (`radarsim.propagation.clutter`). Random numbers depend on the surfaces, not on
the walk's seed: the same surfaces have the same objects in ray tests, cameras, planned paths and ground truth.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import trimesh
from jaxtyping import Float

from radarize.io.errors import InputError
from radarize.io.yamlfile import read_beside
from radarsim.world.generators.furniture import evaluate, make
from radarsim.world.generators.spots import WALLS, Spots, Surroundings
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.shapes import joined


@dataclass(frozen=True, kw_only=True)
class SmallObject:
    """Kind of small object.

    Attributes:
        surface: tops, walls or ceilings.
        often: density at level 1: per square metre of tops and ceilings, per metre of wall.
        least, most: along, across and off the surface, m; round shapes fill their bounding box.
        shape: of `furniture.yaml`.
        material: material of all of it.
        height: lowest and highest height of its centre above the floor, on a wall, m.
        lamp: placed only away from other lamps.
    """

    surface: Literal["top", "wall", "ceiling"]
    often: float
    least: tuple[float, float, float]
    most: tuple[float, float, float]
    shape: str = "block"
    material: str = "vinyl"
    height: tuple[float, float] = (0.0, 0.0)
    lamp: bool = False


@dataclass(frozen=True, kw_only=True)
class Run:
    """Kind of object that runs along a wall.

    Attributes:
        share: fraction of walls with it at level 1.
        across, depth: of its section, m.
        height: height of its centre above the floor, or, if negative, below the ceiling, m.
        least: shortest length, m.
        shape: of `furniture.yaml`.
        material: of all of it.
    """

    share: float
    across: float
    depth: float
    height: float
    least: float
    shape: str = "block"
    material: str = "vinyl"


_FILE = read_beside(__file__)
RUNS = {kind: Run(**about) for kind, about in _FILE["runs"].items()}
OBJECTS = {
    kind: SmallObject(**about | {"often": evaluate(about["often"], {})}) for kind, about in _FILE["objects"].items()
}
#: Largest number of placements tried in a scene; a floor of the largest buildings needs some ten thousand.
MOST = 200_000
#: m: length of the pieces in which runs are tested.
PIECE = 0.1
#: m: highest ceiling.
_HIGHEST = 20.0
#: Margin and free space in front of objects on tops, walls and ceilings, m (`Surroundings.fits`).
ROOM = {"top": (0.005, 0.02), "wall": (0.04, 0.1), "ceiling": (0.12, 0.05)}
#: The same for runs, and free space to the sides.
ALONG = (-0.003, 0.005, -0.005)


def small_objects(objects: Sequence[SceneObject], level: float) -> list[SceneObject]:
    """The small objects of a scene, joined by material.

    Args:
        objects: the scene's surfaces.
        level: 1: the usual number; 0: none.

    Raises:
        InputError: more than `MOST` places would be tried.
    """
    meshes: dict[str, list] = {}
    for kind, spots in placed(objects, level).items():
        about = RUNS[kind] if kind in RUNS else OBJECTS[kind]
        for place, axes, size in zip(spots.place, spots.axes, spots.size, strict=True):
            mesh = shaped(about, size)
            mesh.vertices = mesh.vertices @ axes + place
            meshes.setdefault(about.material, []).append(mesh)
    return [
        SceneObject(f"small objects of {what}", joined(*some), MATERIALS[what], solid=True)
        for what, some in meshes.items()
    ]


def shaped(about: SmallObject | Run, size: Float[np.ndarray, "3"]) -> trimesh.Trimesh:
    """Make an object of a kind and size, on its back."""
    along, across, high = size
    return make(about.shape, material=about.material, along=along, across=across, high=high).parts[about.material]


def placed(objects: Sequence[SceneObject], level: float) -> dict[str, Spots]:
    """Bounding boxes of the objects of each kind."""
    if level == 0 or not objects:
        return {}
    around = Surroundings(objects)
    if (wanted := level * _wanted(around)) > MOST:
        raise InputError(f"clutter is {level:g}, for which {wanted:.2g} objects are tried, expected at most {MOST:g}")
    seed, found = around.seed, {}
    for number, (kind, about) in enumerate((RUNS | OBJECTS).items()):
        rng = np.random.default_rng([seed, number])
        if isinstance(about, Run):
            found[kind] = _along(about, around, level, rng)
        else:
            found[kind] = _scattered(about, around, level, rng)
    owner = np.repeat(list(found), [len(spots) for spots in found.values()])
    spots = Spots.joined(list(found.values()))
    kept = spots.apart()
    return {kind: spots[kept & (owner == kind)] for kind in found}


def _wanted(around: Surroundings) -> float:
    """Number of places tried at level 1."""
    length = around.walls[2].sum()
    extent = {"top": around.area(around.tops), "ceiling": around.area(around.ceilings), "wall": length}
    tried = sum(each.often * extent[each.surface] for each in OBJECTS.values())
    return tried + sum(run.share for run in RUNS.values()) * length / PIECE


def _scattered(about: SmallObject, around: Surroundings, level: float, rng: np.random.Generator) -> Spots:
    """Random positions of a kind: a Poisson process, restricted to free places."""
    if about.surface == "wall":
        place, normal = _on_walls(about, around, level, rng)
        along = np.cross([0.0, 0.0, 1.0], normal)
    else:
        some = around.tops if about.surface == "top" else around.ceilings
        place, normal = around.drawn(rng, some, rng.poisson(level * about.often * around.area(some)))
        normal = np.where(normal[:, 2:] > 0, [0.0, 0.0, 1.0], [0.0, 0.0, -1.0])
        turn = rng.uniform(0, 2 * np.pi, len(place))
        along = np.stack([np.cos(turn), np.sin(turn), np.zeros(len(place))], axis=1)
    size = rng.uniform(about.least, about.most, (len(place), 3))
    spots = Spots(place, along, normal, size)
    spots = spots[around.fits(spots, *ROOM[about.surface])]
    if about.surface != "top":
        spots = spots[around.above_floor(spots)]
    return spots[around.unlit(spots)] if about.lamp else spots


def _on_walls(
    about: SmallObject, around: Surroundings, level: float, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
    """Positions on walls at a kind's height, and normals."""
    begin, normal, length = around.walls
    on = np.repeat(np.arange(len(length)), rng.poisson(level * about.often * length))
    place = begin[on] + (rng.random(len(on)) * length[on])[:, None] * np.cross([0.0, 0.0, 1.0], normal[on])
    place[:, 2] += rng.uniform(*about.height, len(on))
    return place, normal[on]


def _along(run: Run, around: Surroundings, level: float, rng: np.random.Generator) -> Spots:
    """Positions of a run: the free parts of all walls that have it."""
    begin, normal, length = around.walls
    wanted = (rng.random(len(length)) < level * run.share) & (length > run.least)
    begin, normal, length = begin[wanted], normal[wanted], length[wanted]
    count = np.ceil(length / PIECE).astype(int)
    line = np.repeat(np.arange(len(length)), count)
    step = (length / count)[line]
    number = np.arange(len(line)) - np.repeat(np.cumsum(count) - count, count)
    along = np.cross([0.0, 0.0, 1.0], normal)
    place = begin[line] + ((number + 0.5) * step)[:, None] * along[line]
    place[:, 2] += run.height if run.height > 0 else WALLS
    size = np.column_stack([step, np.full(len(line), run.across), np.full(len(line), run.depth)])
    pieces = Spots(place, along[line], normal[line], size)
    good = np.ones(len(line), bool)
    if run.height < 0:
        above = around.headroom(pieces)
        usual = np.array([np.median(above[line == k]) for k in range(len(length))])[line]
        good &= (np.abs(above - usual) < 0.01) & (usual < _HIGHEST) & (usual + run.height > run.across / 2)
        place[good, 2] += usual[good] + run.height
    good &= around.fits(pieces, *ALONG) & around.above_floor(pieces)
    if run.height <= run.across / 2 and run.height > 0:
        good &= around.on_floor(pieces)
    # contiguous pieces, away from the walls at their ends
    edge = np.flatnonzero(np.diff(good, prepend=False) | (np.diff(line, prepend=-1) != 0))
    last = np.append(edge[1:], len(line)) - 1
    edge, last = edge[good[edge]], last[good[edge]]
    ends = pieces.place[edge] - (step / 2 - run.depth)[edge, None] * along[line[edge]]
    long = np.sum((pieces.place[last] - ends) * along[line[edge]], axis=1) + step[edge] / 2 - run.depth
    whole = Spots(
        ends + long[:, None] / 2 * along[line[edge]], pieces.along[edge], pieces.normal[edge],
        np.column_stack([long, size[edge, 1:]]),
    )  # fmt: skip
    return whole[long > run.least]
