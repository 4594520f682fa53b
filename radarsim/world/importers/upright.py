"""Estimate of a mesh's up axis from its geometry, because files do not always follow their format."""

import numpy as np

from radarsim.world.importers.part import Part

#: Faces within this fraction of a mesh's extent from its end belong to that end, and cover it from this fraction of
#: area.
_END, _COVERS = 0.1, 0.5
#: Lengths that differ by less than this factor are not conclusive.
_CLEAR = 1.2


def up_axis(parts: list[Part], usual: str) -> tuple[str, str]:
    """``y`` or ``z``, and the reason: a place has a floor, perhaps no ceiling, and is less high than wide.

    Args:
        parts: in the file's own axes.
        usual: axis of the format, used if the mesh is not conclusive.
    """
    corners = np.concatenate([part.mesh.triangles.reshape(-1, 3) for part in parts])
    normal = np.concatenate([part.mesh.face_normals for part in parts])
    area = np.concatenate([part.mesh.area_faces for part in parts])
    low, size = corners.min(axis=0), np.maximum(np.ptp(corners, axis=0), 1e-9)
    at = (corners.reshape(-1, 3, 3).mean(axis=1) - low) / size
    lies = np.abs(normal) > 0.9
    footprint = size.prod() / size
    floor, ceiling = (
        {axis: area[lies[:, k] & end[:, k]].sum() > _COVERS * footprint[k] for k, axis in ((1, "y"), (2, "z"))}
        for end in (at < _END, at > 1 - _END)
    )
    if floor["y"] != floor["z"]:
        return ("y" if floor["y"] else "z"), "it alone has a floor"
    if floor["y"] and ceiling["y"] != ceiling["z"]:
        return ("z" if ceiling["y"] else "y"), "it has a floor and no ceiling"
    if max(size[1:]) > _CLEAR * min(size[1:]):
        return ("y" if size[1] < size[2] else "z"), "along it the mesh is shorter"
    return usual, "usual in such files"
