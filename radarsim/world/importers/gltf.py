"""Checks of a glTF file's declarations before it is loaded (glTF 2.0 specification, sections 3.5.2 and 3.6)."""

import struct
from pathlib import Path

from radarize.io.errors import explained
from radarize.io.files import read_bytes
from radarize.io.jsonfile import parse_json

#: Largest size of a file, bytes, and largest number of corners of all instances of its meshes.
_BYTES, _CORNERS = 512 << 20, 15_000_000
#: Bytes per component, and components per entry.
_COMPONENTS = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_ENTRIES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


def check(path: Path) -> None:
    """Reject a file whose nodes are no trees, whose arrays exceed their buffers, or that expands to too many corners.

    Raises:
        InputError: the file is rejected, or is no such file.
    """
    content = read_bytes(path, "a glTF file", _BYTES)
    with explained(f"{path}: is not a readable glTF file"):
        if content[:4] == b"glTF":
            (length,) = struct.unpack_from("<I", content, 12)
            content = content[20 : 20 + length]
        tree = parse_json(content.decode(), "its header")
        for number, accessor in enumerate(tree.get("accessors", ())):
            _within(tree, number, accessor)
        corners = [sum(_corners(tree, part) for part in mesh["primitives"]) for mesh in tree.get("meshes", ())]
        nodes = tree.get("nodes", [])
        _trees(nodes)
        total = sum(corners[node["mesh"]] for node in nodes if "mesh" in node)
        if total > _CORNERS:
            raise ValueError(f"its nodes show {total} corners, expected at most {_CORNERS}")


def _trees(nodes: list[dict]) -> None:
    """Check that every node has at most one parent, and a root above it."""
    children = [child for node in nodes for child in node.get("children", ())]
    if len(set(children)) < len(children) or not set(children) <= set(range(len(nodes))):
        raise ValueError("a node is the child of several, expected trees of nodes")
    below, reached = [k for k in range(len(nodes)) if k not in set(children)], 0
    while below:
        reached += 1
        below += nodes[below.pop()].get("children", ())
    if reached < len(nodes):
        raise ValueError("a node is its own ancestor, expected trees of nodes")


def _within(tree: dict, number: int, accessor: dict) -> None:
    """Check that an accessor's entries lie in its view, and the view in its buffer."""
    size = _COMPONENTS[accessor["componentType"]] * _ENTRIES[accessor["type"]]
    count, start = accessor["count"], accessor.get("byteOffset", 0)
    if "bufferView" in accessor:
        view = tree["bufferViews"][accessor["bufferView"]]
        room, offset = view["byteLength"], view.get("byteOffset", 0)
        fits = offset >= 0 and offset + room <= tree["buffers"][view["buffer"]]["byteLength"]
        fits &= start >= 0 and start + (count - 1) * view.get("byteStride", size) + size <= room
    else:
        fits = count <= _CORNERS  # zeros
    if not fits or count < 0:
        raise ValueError(f"accessor {number} has {count} entries, expected no more than its bytes hold")


def _corners(tree: dict, part: dict) -> int:
    return tree["accessors"][part.get("indices", part["attributes"]["POSITION"])]["count"]
