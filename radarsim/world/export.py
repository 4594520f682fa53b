"""Export of scenes as meshes for other programs: glTF (``.glb``), PLY, OBJ and STL."""

from pathlib import Path

import numpy as np
import trimesh

from radarize.io.errors import InputError
from radarize.io.replacing import replacing
from radarsim.world.scene import Scene

#: Formats by suffix. glTF has y up (its specification, section 3.4); the others have z up here, as scenes do.
SUFFIXES = (".glb", ".ply", ".obj", ".stl")
_Y_UP = trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0))


def export_scene(scene: Scene, output: str | Path) -> Path:
    """Write a scene's objects as a mesh, m. Clutter points and people, which are drawn per recording, are not included.

    Args:
        scene: the world.
        output: ``.glb``: one node per object, with the material's name and colour, from which `radarsim scene import`
            restores the materials; ``.ply``: one mesh with coloured faces; ``.obj`` or ``.stl``: one mesh.

    Raises:
        InputError: another suffix, or the file cannot be written.

    Example:
        >>> export_scene(Scene.load("office"), "office.glb")
    """
    output = Path(output)
    suffix = output.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{output}: is of an unknown format, expected a name that ends in {', '.join(SUFFIXES)}")
    content = _nodes(scene) if suffix == ".glb" else _whole(scene)
    with replacing(output) as part:
        data = content.export(file_type=suffix[1:])
        assert isinstance(data, str | bytes)  # of single files
        part.write_bytes(data.encode() if isinstance(data, str) else data)
    return output


def _nodes(scene: Scene) -> trimesh.Scene:
    found = trimesh.Scene()
    for item in scene.objects:
        look = trimesh.visual.material.PBRMaterial(
            name=item.material.name, baseColorFactor=[*item.material.color, 1.0], metallicFactor=0.0, doubleSided=True
        )
        mesh = trimesh.Trimesh(item.mesh.vertices, item.mesh.faces, process=False)
        mesh.visual = trimesh.visual.TextureVisuals(material=look)
        found.add_geometry(mesh, node_name=item.name, geom_name=item.name, transform=_Y_UP)
    return found


def _whole(scene: Scene) -> trimesh.Trimesh:
    """All triangles as one mesh, each with the colour of its material."""
    colors = np.array([item.material.color for item in scene.objects])[scene.triangle_object]
    faces = np.arange(3 * len(scene.triangles)).reshape(-1, 3)
    rgba = np.column_stack([np.rint(255 * colors), np.full(len(colors), 255)]).astype(np.uint8)
    return trimesh.Trimesh(scene.triangles.reshape(-1, 3), faces, face_colors=rgba, process=False)
