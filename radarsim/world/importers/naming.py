"""Material of an imported part: by the user's patterns, by the source's material, or by the words of its name."""

import re
from fnmatch import fnmatchcase
from pathlib import Path

from radarize.io.errors import InputError
from radarize.io.yamlfile import read_beside, read_yaml
from radarsim.world.description import CustomMaterial
from radarsim.world.importers.part import Part
from radarsim.world.materials import MATERIALS, material
from radarsim.world.validation import naming

Choice = str | dict

_MEANING = {word: name for name, words in read_beside(__file__).items() for word in words.split()}
_MEANING |= {name: name for name in MATERIALS if " " not in name}


class MaterialMap:
    """Patterns and their materials; the first match applies.

    The file is YAML, ``pattern: material``, a material being a name or ``{custom: {...}}`` as in scene files; patterns
    (``*``, ``?``, ``[...]``, case ignored) are tried on a part's name, material, group and category.
    """

    def __init__(self, patterns: dict[str, Choice], default: Choice | None):
        self.patterns, self.default = patterns, default

    @classmethod
    def read(cls, path: Path | None, default: str | None) -> "MaterialMap":
        """The map of a file.

        Args:
            path: none: no patterns.
            default: material of parts without a known name; None: plasterboard, and concrete for whole rooms.

        Raises:
            InputError: unreadable, malformed, or an unknown material, with the pattern.
        """
        if default is not None:
            material(default)
        if path is None:
            return cls({}, default)
        data = read_yaml(path)
        if not isinstance(data, dict):
            raise InputError(f"{path}: holds {type(data).__name__}, expected lines 'pattern: material'")
        for pattern, choice in data.items():
            with naming(f"{path}: {pattern}", choice):
                material(choice) if isinstance(choice, str) else CustomMaterial.model_validate(choice)
        return cls({str(pattern): choice for pattern, choice in data.items()}, default)

    def choose(self, part: Part) -> tuple[Choice, str]:
        """Material of a part, and the reason for the choice."""
        names = [name.lower() for name in (part.name, *part.labels)]
        for pattern, choice in self.patterns.items():
            if any(fnmatchcase(name, pattern.lower()) for name in names):
                return choice, f"pattern {pattern}"
        if part.material is not None:
            return part.material, "source"
        # A material's name has priority over an object's.
        for name in (*part.labels, part.name):
            if guess := meaning(name):
                return guess, "name" if name == part.name else f"label {name}"
        return self.default or ("concrete" if part.room else "plasterboard"), "default"


def meaning(name: str) -> str | None:
    """Material that the words of a name stand for: a material (``mat-itu_glass``), or that of a kind of object."""
    words = re.findall(r"[a-z]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower())
    plain = " ".join(word for word in words if word not in ("itu", "mat", "material"))
    for known in sorted(MATERIALS, key=len, reverse=True):
        if f" {known} " in f" {plain} ":
            return known
    # The last word is the object itself: a "wall cabinet" is a cabinet.
    return next((_MEANING[word] for word in reversed(words) if word in _MEANING), None)
