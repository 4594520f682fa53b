"""Building from an occupancy grid: walls, free-standing objects, floor and ceiling."""

from collections.abc import Callable

import numpy as np
import shapely
import trimesh
from jaxtyping import Bool
from scipy import ndimage
from shapely.geometry import MultiPolygon, Polygon

from radarize.io.errors import InputError
from radarsim.world import shapes
from radarsim.world.importers.faces import Face, faces, rooms
from radarsim.world.importers.occupancy import OccupancyGrid
from radarsim.world.importers.part import Part, unreported
from radarsim.world.planes import trapezoids

#: Height of occupied cells that are no walls (chairs, boxes, people who stood still), m.
CLUTTER = 1.0
#: Smallest number of connected occupied cells that are not noise.
_SPECK = 4
#: Size of the squares of floor and ceiling, m: few rectangles instead of an exact edge, which walls hide.
_TILE = 0.5
#: Narrower gaps between walls are closed, m.
_SLIT = 0.2
#: Smaller holes are closed, in walls and floors, m^2.
_COURT = 1.0


def parts(
    grid: OccupancyGrid, height: float, thickness: float, source: str, progress: Callable[..., object] = unreported
) -> list[Part]:
    """Parts of a building from a grid: ``walls``, ``clutter``, ``floor`` and ``ceiling``.

    Args:
        grid: occupied and free cells.
        height: floor to ceiling, m.
        thickness: of the thinnest wall, m.
        source: for messages.
        progress: called with a stage's name, steps done, total steps.

    Raises:
        InputError: no free ground, or nothing occupied around it.
    """
    inside = rooms(grid)
    if not inside.any():
        raise InputError(f"{source}: has no square metre of free ground together, expected the map of a building")
    progress("finding walls", 0, 3)
    found = faces(grid, inside)
    progress("finding walls", 1, 3)
    if not found:
        raise InputError(f"{source}: has no straight wall beside its free ground, expected the map of a building")
    solid = walls(found, thickness, grid, inside)
    progress("finding walls", 2, 3)
    rest = clutter(grid, inside, solid)
    progress("finding walls", 3, 3)
    built = [Part("walls", upright(_placed(solid, grid), height), "plasterboard", solid=True)]
    if rest:
        low = _placed(MultiPolygon(rest), grid)
        built.append(Part("clutter", upright(low, min(CLUTTER, height), lid=True), "wood", solid=True))
    tiles = _tiles(grid, inside)
    floor = shapes.joined(*(_lying(tile, grid, 0.0, 1) for tile in tiles))
    ceiling = shapes.joined(*(_lying(tile, grid, height, -1) for tile in tiles))
    return [*built, Part("floor", floor, "vinyl"), Part("ceiling", ceiling, "ceiling board")]


def walls(
    found: list[Face], thickness: float, grid: OccupancyGrid, inside: Bool[np.ndarray, "x y"]
) -> shapely.Geometry:
    """Area of walls: behind each face, with depth `thickness` or up to the middle of a thinner wall."""
    bodies = []
    for number, face in enumerate(found):
        behind = _depth(face, thickness, grid, inside)
        front = max(0.0, (thickness - behind) / 2) if behind < thickness else 0.0
        low = face.low - _overlap(face, face.low, -1, found, number, thickness)
        high = face.high + _overlap(face, face.high, 1, found, number, thickness)
        along, across = face.direction, face.normal
        corners = [(low, front), (high, front), (high, front - thickness), (low, front - thickness)]
        bodies.append(Polygon([face.center + a * along + b * across for a, b in corners]))
    union = shapely.union_all(shapely.set_precision(bodies, 1e-4))
    # Slits remain where lines do not quite meet, and between the two faces of a thick wall; so do small courts.
    closed = union.buffer(_SLIT / 2, join_style="mitre", mitre_limit=2)
    closed = closed.buffer(-_SLIT / 2 - 0.02, join_style="mitre", mitre_limit=2)
    closed = shapely.simplify(closed.buffer(0.02, join_style="mitre", mitre_limit=2), 0.01)
    return shapely.union_all([_without_courts(part) for part in shapely.get_parts(closed)])


def _without_courts(part: Polygon) -> Polygon:
    return Polygon(part.exterior, [ring for ring in part.interiors if Polygon(ring).area >= _COURT])


def _depth(face: Face, thickness: float, grid: OccupancyGrid, inside: Bool[np.ndarray, "x y"]) -> float:
    """Distance behind a face at which free ground begins again, m, at most `thickness`."""
    steps = np.arange(1.0, np.ceil(thickness / grid.resolution) + 2)
    along = np.linspace(face.low, face.high, max(3, int(face.length / grid.resolution)))
    at = face.center + along[:, None, None] * face.direction - steps[:, None] * grid.resolution * face.normal
    free = inside[grid.cells(at)].mean(axis=0) > 0.5
    return min(thickness, float(steps[free.argmax()] - 0.5) * grid.resolution) if free.any() else thickness


def _overlap(face: Face, end: float, sign: int, found: list[Face], number: int, thickness: float) -> float:
    """Extension of a wall's body beyond the end of its face, m: into the wall that it meets there."""
    corner = face.center + end * face.direction
    for other, mate in enumerate(found):
        if other == number:
            continue
        offset = corner - mate.center
        if abs(offset @ mate.normal) < 1e-6 and mate.low - 1e-6 <= offset @ mate.direction <= mate.high + 1e-6:
            if sign * (face.direction @ mate.normal) < -0.1:
                return thickness
    return 0.0


def clutter(grid: OccupancyGrid, inside: Bool[np.ndarray, "x y"], solid: shapely.Geometry) -> list[Polygon]:
    """Outlines of free-standing objects: occupied cells apart from the walls."""
    cell = grid.resolution
    taken = solid.buffer(1.5 * cell)
    shapely.prepare(taken)
    found = []
    i, j = np.nonzero(grid.occupied & ndimage.binary_dilation(inside, iterations=2))
    loose = ~shapely.contains_xy(taken, (i + 0.5) * cell, (j + 0.5) * cell)
    mask = np.zeros(inside.shape, bool)
    mask[i[loose], j[loose]] = True
    labels, _ = ndimage.label(mask, np.ones((3, 3)))
    for index, window in enumerate(ndimage.find_objects(labels), 1):
        i, j = np.nonzero(labels[window] == index)
        if len(i) < _SPECK:
            continue
        x, y = (i + window[0].start) * cell, (j + window[1].start) * cell
        blob = shapely.union_all(shapely.box(x, y, x + cell, y + cell))
        hull = shapely.minimum_rotated_rectangle(blob)
        found.append(hull if blob.area > 0.5 * hull.area else shapely.simplify(blob.buffer(cell / 2), cell))
    apart = shapely.difference(shapely.union_all(found), solid) if found else MultiPolygon()
    return [part for part in shapely.get_parts(apart) if isinstance(part, Polygon) and part.area > cell**2]


def upright(area: shapely.Geometry, height: float, lid: bool = False) -> trimesh.Trimesh:
    """Vertical sides of an area from the floor to `height` (m), seen from outside; with its top if `lid`."""
    whole = shapes.joined(*(trimesh.creation.extrude_polygon(part, height) for part in shapely.get_parts(area)))
    whole.update_faces((whole.face_normals[:, 2] > -0.5) & (lid | (whole.face_normals[:, 2] < 0.5)))
    return whole


def _placed(area: shapely.Geometry, grid: OccupancyGrid) -> shapely.Geometry:
    return shapely.transform(area, grid.to_world)


def _tiles(grid: OccupancyGrid, inside: Bool[np.ndarray, "x y"]) -> list[Polygon]:
    """Cover the free ground and a margin by few rectangles."""
    size = max(1, round(_TILE / grid.resolution))
    around = np.pad(inside, [(0, -n % size) for n in inside.shape])
    coarse = around.reshape(around.shape[0] // size, size, around.shape[1] // size, size).any(axis=(1, 3))
    i, j = np.nonzero(coarse)
    step = size * grid.resolution
    area = shapely.union_all(shapely.box(i * step, j * step, (i + 1) * step, (j + 1) * step))
    area = shapely.union_all([_without_courts(part) for part in shapely.get_parts(area)])
    return [Polygon(corners) for corners in trapezoids(area)]


def _lying(tile: Polygon, grid: OccupancyGrid, level: float, facing: int) -> trimesh.Trimesh:
    corners = grid.to_world(np.asarray(tile.exterior.coords)[:4, :2][:: 1 if tile.exterior.is_ccw else -1][::facing])
    return trimesh.Trimesh(np.column_stack([corners, np.full(4, level)]), [[0, 1, 2], [0, 2, 3]], process=False)
