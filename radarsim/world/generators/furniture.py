"""Furniture, fittings and small objects as meshes by material, each in its own frame (`furniture.yaml`)."""

import ast
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from types import CodeType
from typing import Any

import numpy as np
import trimesh

from radarize.io.yamlfile import read_beside
from radarsim.world import shapes

#: Names available to formulas in the file, beside a piece's variables.
_NAMES = {name: getattr(np, name) for name in ("arange", "arctan2", "cos", "hypot", "linspace", "pi", "sin")}
_NAMES |= {"__builtins__": {}, "len": len, "max": max, "min": min, "range": range, "round": round}
_ARITHMETIC = (
    ast.Expression, ast.BinOp, ast.UnaryOp, ast.Constant, ast.Name, ast.Tuple, ast.List, ast.Subscript, ast.Slice,
    ast.Call, ast.Compare, ast.expr_context, ast.operator, ast.unaryop, ast.cmpop,
)  # fmt: skip


@dataclass(frozen=True)
class Piece:
    """One piece of furniture.

    Attributes:
        kind: e.g. ``desk``.
        depth, width: footprint along x and y, m.
        parts: meshes by material name.
    """

    kind: str
    depth: float
    width: float
    parts: dict[str, trimesh.Trimesh]


def make(kind: str, rng: np.random.Generator | None = None, material: str = "", **given: Any) -> Piece:
    """Make a piece.

    Args:
        kind: key in `furniture.yaml`.
        rng: random generator for variables that are not given.
        material: material of its `own` parts; default: as in the file.
        given: variables.
    """
    about, values = _table()[kind], dict[str, Any](given)
    found: dict[str, list[trimesh.Trimesh]] = {}
    for name, choice in about.get("with", {}).items():
        if name not in given:
            values[name] = _needed(rng).choice(choice) if isinstance(choice, list) else value(choice, values, rng)
    for what, shape, arguments, *more in about["parts"]:
        without, variables = more + ["", {}][len(more) :]
        what = (material or about["material"]) if what == "own" else what
        for each in _repeated([*variables.items()], values, rng):
            mesh = getattr(shapes, shape)(*evaluate(arguments, each), *([tuple(without.split())] if without else ()))
            turned = shapes.placed(mesh, each["at"], each["turn"]) if "turn" in each else mesh
            found.setdefault(what, []).append(turned)
    depth, width = evaluate(about.get("size", [0, 0]), values)
    return Piece(kind, depth, width, {what: shapes.joined(*some) for what, some in found.items()})


def evaluate(formula: object, values: Mapping[str, object]) -> Any:
    """Evaluate a formula, or a list of them, from a file of this package."""
    return eval(_compiled(_source(formula)), _NAMES, values)


@cache
def _table() -> dict[str, dict]:
    return read_beside(__file__)


def _repeated(variables: list[tuple], values: dict, rng: np.random.Generator | None) -> Iterator[dict]:
    """Yield a part's variables for each combination of those with several values."""
    if not variables:
        yield values
        return
    (name, choice), *rest = variables
    found = value(choice, values, rng)
    for each in [found] if np.ndim(found) == 0 or name in ("at", "turn") else found:
        yield from _repeated(rest, values | {name: each}, rng)


def value(choice: object, values: dict, rng: np.random.Generator | None) -> Any:
    """Draw a uniform number between two (`from` and `to`), or evaluate a formula."""
    return _needed(rng).uniform(choice["from"], choice["to"]) if isinstance(choice, dict) else evaluate(choice, values)


def _needed(rng: np.random.Generator | None) -> np.random.Generator:
    if rng is None:
        raise ValueError("nothing to draw with, expected a generator or all variables of the piece")
    return rng


def _source(formula: object) -> str:
    return f"({','.join(map(_source, formula))},)" if isinstance(formula, list) else str(formula)


@cache
def _compiled(source: str) -> CodeType:
    """Compile a formula of arithmetic, comparisons, and calls of names in `_NAMES`; nothing else is allowed."""
    tree = ast.parse(source, "furniture.yaml", "eval")
    calls = {node.func for node in ast.walk(tree) if isinstance(node, ast.Call)}
    odd = [node for node in ast.walk(tree) if not isinstance(node, _ARITHMETIC)]
    odd += [node for node in calls if not (isinstance(node, ast.Name) and node.id in _NAMES)]
    if odd:
        raise ValueError(f"formula {source!r} holds {ast.unparse(odd[0])!r}, expected arithmetic")
    return compile(tree, "furniture.yaml", "eval")
