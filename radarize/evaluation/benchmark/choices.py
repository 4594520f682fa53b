"""Recordings that results are of, and which of them settings were tuned on: results on these are optimistic, and every
page of results lists them.

Networks are not included: each file of weights names its training data. Enter recordings that a setting is tuned on in
``choices.yaml``.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from radarize.io.recording import Recording
from radarize.io.tum import planar
from radarize.io.yamlfile import read_beside

#: Seeds by scene.
Seeds = dict[str, tuple[int | None, ...]]


@dataclass(frozen=True)
class NamedWalk:
    """A recording that results are of.

    Attributes:
        scene: name of the scene.
        seed: seed of a simulated recording; None of a real one.
        metres: length of the path in the plane, m; None without true poses.
        simulated: whether it is simulated.
    """

    scene: str
    seed: int | None
    metres: float | None
    simulated: bool

    @classmethod
    def of(cls, recording: Recording) -> "NamedWalk":
        """Read the attributes and poses of a recording."""
        about, metres = recording.attributes, None
        if recording.has("truth/pose"):
            places = planar(recording.read("truth/pose"))[:, :2]
            metres = float(np.linalg.norm(np.diff(places[np.isfinite(places).all(axis=1)], axis=0), axis=1).sum())
        simulated = str(about.get("source", "")).startswith("radarsim")
        seed = int(str(about["seed"])) if "seed" in about else None
        return cls(str(about.get("scene", "-")), seed, metres, simulated)

    @classmethod
    def radarhd(cls, number: int) -> "NamedWalk":
        """Return a walk of RadarHD's repository by its number."""
        return cls(f"radarhd {number}", None, None, False)


@dataclass(frozen=True)
class Choice:
    """Settings, and the recordings they were tuned on.

    Attributes:
        settings: description of the settings.
        recordings: seeds by scene; None: any seed.
        looked_at: maximum number of these recordings that were used, if it is not recorded which; 0: all.
    """

    settings: str
    recordings: Seeds
    looked_at: int = 0

    def among(self, walks: Sequence[NamedWalk]) -> int:
        """Return how many of some recordings the settings may have been tuned on."""
        hits = sum(bool({walk.seed, None} & {*self.recordings.get(walk.scene, ())}) for walk in walks)
        return min(hits, self.looked_at or hits)


def _joined(*sets: Seeds) -> Seeds:
    """Return the union of sets."""
    scenes = dict.fromkeys(scene for each in sets for scene in each)
    return {scene: tuple(dict.fromkeys(seed for each in sets for seed in each.get(scene, ()))) for scene in scenes}


def _seeds(walks: dict[str, list[int | None]]) -> Seeds:
    return {scene: tuple(seeds) for scene, seeds in walks.items()}


def _sets(known: dict[str, dict]) -> dict[str, Seeds]:
    found: dict[str, Seeds] = {}
    for name, about in known.items():  # parts of other sets come before them
        own = _seeds({scene: seeds for scene, seeds in about.items() if scene not in ("of", "radarhd")})
        own |= {NamedWalk.radarhd(number).scene: (None,) for number in about.get("radarhd", ())}
        found[name] = _joined(*(found[other] for other in about.get("of", ())), own)
    return found


_FILE = read_beside(__file__)
#: Sets of recordings by name.
SETS = _sets(_FILE["sets"])
#: RadarHD's training walks.
TRAINING = tuple(_FILE["sets"]["PICTURES"]["radarhd"])
CHOICES = tuple(
    Choice(
        each["settings"],
        _joined(
            *(SETS[name] for name in each.get("sets", ())), {k: tuple(v) for k, v in each.get("walks", {}).items()}
        ),
        each.get("looked_at", 0),
    )
    for each in _FILE["choices"]
)


def tuned_on(walks: Sequence[NamedWalk]) -> list[str]:
    """Return sentences that list which of some recordings settings were tuned on."""
    found = []
    for choice in CHOICES:
        if count := choice.among(walks):
            most = "at most " if choice.looked_at else ""
            found.append(f"{most}{count} of {len(walks)} in the tuning set of {choice.settings}")
    scenes = {scene for choice in CHOICES for scene in choice.recordings} & {walk.scene for walk in walks}
    if not found and walks:
        found = ["none in a tuning set"]
        found += [f"other walks through {', '.join(sorted(scenes))} are"] if scenes else []
    return found
