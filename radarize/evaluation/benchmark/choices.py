"""What recordings figures are of, and which of them helped to choose settings: figures on these flatter, and every page
of results says so.

Networks are not among them: each file of weights names its training data. Whoever chooses a setting by looking at
recordings enters them in ``choices.yaml``.
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
    """A recording, or a part of one, that figures are of.

    Attributes:
        scene: that it went through.
        seed: that it was drawn from; None of a real one.
        metres: in the plane; None where no true poses tell.
        simulated: or real.
    """

    scene: str
    seed: int | None
    metres: float | None
    simulated: bool

    @classmethod
    def of(cls, recording: Recording) -> "NamedWalk":
        """As a recording says."""
        about, metres = recording.attributes, None
        if recording.has("truth/pose"):
            places = planar(recording.read("truth/pose"))[:, :2]
            metres = float(np.linalg.norm(np.diff(places[np.isfinite(places).all(axis=1)], axis=0), axis=1).sum())
        simulated = str(about.get("source", "")).startswith("radarsim")
        seed = int(str(about["seed"])) if "seed" in about else None
        return cls(str(about.get("scene", "-")), seed, metres, simulated)

    @classmethod
    def radarhd(cls, number: int) -> "NamedWalk":
        """One of RadarHD's repository."""
        return cls(f"radarhd {number}", None, None, False)


@dataclass(frozen=True)
class Choice:
    """Settings, and what they were chosen on.

    Attributes:
        settings: in words.
        recordings: seeds by scene; None: whatever its seed.
        looked_at: so many of them at most, if nobody knows any more which; 0: all.
    """

    settings: str
    recordings: Seeds
    looked_at: int = 0

    def among(self, walks: Sequence[NamedWalk]) -> int:
        """How many of some recordings may have been looked at."""
        hits = sum(bool({walk.seed, None} & {*self.recordings.get(walk.scene, ())}) for walk in walks)
        return min(hits, self.looked_at or hits)


def _joined(*sets: Seeds) -> Seeds:
    """The union of sets."""
    scenes = dict.fromkeys(scene for each in sets for scene in each)
    return {scene: tuple(dict.fromkeys(seed for each in sets for seed in each.get(scene, ()))) for scene in scenes}


def _seeds(walks: dict[str, list[int | None]]) -> Seeds:
    return {scene: tuple(seeds) for scene, seeds in walks.items()}


def _sets(known: dict[str, dict]) -> dict[str, Seeds]:
    found: dict[str, Seeds] = {}
    for name, about in known.items():  # those that others are made of come first
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


def helped(walks: Sequence[NamedWalk]) -> list[str]:
    """Sentences on which of some recordings helped to choose settings."""
    found = []
    for choice in CHOICES:
        if count := choice.among(walks):
            most = "at most " if choice.looked_at else ""
            found.append(f"{most}{count} of {len(walks)} helped to choose {choice.settings}")
    scenes = {scene for choice in CHOICES for scene in choice.recordings} & {walk.scene for walk in walks}
    if not found and walks:
        found = ["none helped to choose settings"]
        found += [f"other walks through {', '.join(sorted(scenes))} did"] if scenes else []
    return found
