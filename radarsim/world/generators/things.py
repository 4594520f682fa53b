"""What tells a lived-in place from its drawing, down to 2 cm: which things stand on its tops, hang on its walls and
under its ceilings. What is smaller is a layer of points (`radarsim.propagation.clutter`).

The same surfaces have the same things: random numbers follow from them, not from the walk's seed. So all that looks at
a scene, ray tests, cameras, planned ways and truth, finds them in it.
"""

from collections.abc import Sequence

import numpy as np

from radarize.errors import InputError
from radarsim.world.generators.belongings import RUNS, THINGS, Run, Thing
from radarsim.world.generators.spots import WALLS, Spots, Surroundings
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.shapes import joined

#: Things and pieces of runs that are tried for a place: a floor of the largest buildings takes some ten thousand.
MOST = 200_000
#: m: runs are looked at in pieces so long.
PIECE = 0.1
#: m: above what is higher over a wall's line there is no ceiling.
_HIGHEST = 20.0
#: Rim and free space in front of what is on tops, walls and ceilings, m (`Surroundings.fits`).
ROOM = {"top": (0.005, 0.02), "wall": (0.04, 0.1), "ceiling": (0.12, 0.05)}
#: The same of runs, and how far to the sides.
ALONG = (-0.003, 0.005, -0.005)


def things(objects: Sequence[SceneObject], level: float) -> list[SceneObject]:
    """What a place has beside its drawing, as one object of each material.

    Args:
        objects: the drawing.
        level: 1: as many as is usual; 0: none.

    Raises:
        InputError: more than `MOST` were to be tried.
    """
    meshes: dict[str, list] = {}
    for kind, spots in placed(objects, level).items():
        told = RUNS[kind] if kind in RUNS else THINGS[kind]
        for place, axes, size in zip(spots.place, spots.axes, spots.size, strict=True):
            shape = told.shape(size)
            shape.vertices = shape.vertices @ axes + place
            meshes.setdefault(told.material, []).append(shape)
    return [
        SceneObject(f"things of {what}", joined(*some), MATERIALS[what], solid=True) for what, some in meshes.items()
    ]


def placed(objects: Sequence[SceneObject], level: float) -> dict[str, Spots]:
    """The boxes that things of each kind take."""
    if level == 0 or not objects:
        return {}
    around = Surroundings(objects)
    if (wanted := level * _wanted(around)) > MOST:
        raise InputError(f"clutter is {level:g}, for which {wanted:.2g} things are tried, expected at most {MOST:g}")
    seed, found = around.seed, {}
    for number, (kind, told) in enumerate((RUNS | THINGS).items()):
        rng = np.random.default_rng([seed, number])
        found[kind] = (_along if isinstance(told, Run) else _scattered)(told, around, level, rng)
    owner = np.repeat(list(found), [len(spots) for spots in found.values()])
    spots = Spots.joined(list(found.values()))
    kept = spots.apart()
    return {kind: spots[kept & (owner == kind)] for kind in found}


def _wanted(around: Surroundings) -> float:
    """How many things and pieces of runs are tried at level 1."""
    length = around.walls[2].sum()
    extent = {"top": around.area(around.tops), "ceiling": around.area(around.ceilings), "wall": length}
    tried = sum(thing.often * extent[thing.on] for thing in THINGS.values())
    return tried + sum(run.share for run in RUNS.values()) * length / PIECE


def _scattered(thing: Thing, around: Surroundings, level: float, rng: np.random.Generator) -> Spots:
    """Where things of a kind are: a Poisson process, where there is room."""
    if thing.on == "wall":
        place, normal = _on_walls(thing, around, level, rng)
        along = np.cross([0.0, 0.0, 1.0], normal)
    else:
        some = around.tops if thing.on == "top" else around.ceilings
        place, normal = around.drawn(rng, some, rng.poisson(level * thing.often * around.area(some)))
        normal = np.where(normal[:, 2:] > 0, [0.0, 0.0, 1.0], [0.0, 0.0, -1.0])
        turn = rng.uniform(0, 2 * np.pi, len(place))
        along = np.stack([np.cos(turn), np.sin(turn), np.zeros(len(place))], axis=1)
    size = rng.uniform(thing.least, thing.most, (len(place), 3))
    spots = Spots(place, along, normal, size)
    spots = spots[around.fits(spots, *ROOM[thing.on])]
    if thing.on != "top":
        spots = spots[around.above_floor(spots)]
    return spots[around.unlit(spots)] if thing.lamp else spots


def _on_walls(thing: Thing, around: Surroundings, level: float, rng: np.random.Generator):
    """Places on walls at a kind's height, and normals."""
    begin, normal, length = around.walls
    on = np.repeat(np.arange(len(length)), rng.poisson(level * thing.often * length))
    place = begin[on] + (rng.random(len(on)) * length[on])[:, None] * np.cross([0.0, 0.0, 1.0], normal[on])
    place[:, 2] += rng.uniform(*thing.height, len(on))
    return place, normal[on]


def _along(run: Run, around: Surroundings, level: float, rng: np.random.Generator) -> Spots:
    """Where something runs along walls: all of a wall that has it, as far as that is free."""
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
    size = np.column_stack([step, np.full(len(line), run.across), np.full(len(line), run.off)])
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
    # whole stretches, off the walls that they end at
    edge = np.flatnonzero(np.diff(good, prepend=False) | (np.diff(line, prepend=-1) != 0))
    last = np.append(edge[1:], len(line)) - 1
    edge, last = edge[good[edge]], last[good[edge]]
    ends = pieces.place[edge] - (step / 2 - run.off)[edge, None] * along[line[edge]]
    long = np.sum((pieces.place[last] - ends) * along[line[edge]], axis=1) + step[edge] / 2 - run.off
    whole = Spots(
        ends + long[:, None] / 2 * along[line[edge]], pieces.along[edge], pieces.normal[edge],
        np.column_stack([long, size[edge, 1:]]),
    )  # fmt: skip
    return whole[long > run.least]
