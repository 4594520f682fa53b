"""Task to make one recording of a data set: parameters, whether it is finished, and its simulation."""

import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from radarize import __version__
from radarize.io.errors import InputError, explained
from radarize.io.recording import Recording
from radarize.radar.presets import load_config
from radarsim.dataset import physics
from radarsim.dataset.randomise import OF_SENSOR, mounting
from radarsim.dataset.variant import Attributes, Variant
from radarsim.world.description import meshes, split_level

#: Attribute of a recording with its task's parameters.
ATTRIBUTE = "task"
#: Suffixes of temporary files beside an unfinished recording: its samples, or those of its heat maps.
_LEFTOVERS = (".part", ".begun", ".raw.part", ".raw.part.part", ".raw.part.begun")


class Stale(InputError):
    """The recording has other parameters than its task."""


@dataclass(frozen=True)
class Task:
    """One recording to make.

    Attributes:
        name: name of the recording, without suffix.
        building, floor: as in the specification.
        platform: how the sensor moves.
        scene: scene description, or the path of its file (with a level, ``corner.yaml@2``).
        duration: duration, s.
        frames: number of frames of the recording.
        seed: of tour, scatterers and noise.
        radar: radar preset or configuration file.
        frontend: front-end file; None for the default.
        settings: digest of the contents of radar and front-end files.
        sensors: truth sensors.
        storage: ``raw`` or ``heatmaps``.
        waypoints: way-points instead of a tour, m.
        content: digests of the scene's files, see `content`; None: the scene has no file.
        variant: changes against other recordings of the same walk.
        attributes: attributes of the recording.
        people: number of pedestrians near the radar's path.
        randomised: values drawn for it, see `Randomise.draw`.
    """

    name: str
    building: str
    floor: int | None
    platform: str
    scene: dict | str
    duration: float
    frames: int
    seed: int
    radar: str
    frontend: str | None
    settings: str
    sensors: tuple[str, ...]
    storage: str
    waypoints: tuple[tuple[float, float], ...] | None = None
    content: dict[str, object] | None = None
    variant: Variant = Variant()
    attributes: Attributes = field(default_factory=dict)
    people: int = 0
    randomised: dict[str, Any] = field(default_factory=dict)

    @property
    def parameters(self) -> dict[str, object]:
        """All parameters that determine the recording's bytes; files by their content, so that they may move.

        The version is included beside the sources of the physics, because it determines heat maps and compression.
        """
        found = asdict(self) | {"sensors": list(self.sensors), "version": __version__, "physics": physics.digest()}
        for file in ("radar", "frontend"):
            found[file] = found[file] and Path(found[file]).name
        found["attributes"] = self.attributes or None  # absent in recordings of older versions
        found["people"] = self.people or None
        found["randomised"] = self.randomised or None
        found["variant"] = self.variant.model_dump(mode="json", exclude_defaults=True) or None
        found["scene"] = found.pop("content") or self.scene
        return found

    @property
    def identity(self) -> str:
        """`parameters` as JSON text, as stored in the recording."""
        return json.dumps(self.parameters, sort_keys=True)

    def path(self, folder: Path) -> Path:
        """Path of the recording."""
        return folder / f"{self.name}.h5"

    def is_finished(self, folder: Path) -> bool:
        """Whether the recording exists, is whole, and has all its sensors.

        Raises:
            Stale: it exists but has other parameters, or is not part of a data set.
        """
        return self._lacking(folder) == []

    def _lacking(self, folder: Path) -> list[str] | None:
        """Sensors still missing in the recording; None if it does not exist or is not whole. Raises as
        `is_finished`."""
        try:
            with Recording(self.path(folder)) as recording:
                frames, text = len(recording), recording.attributes.get(ATTRIBUTE)
        except InputError:
            return None  # missing, truncated or damaged
        if text is None:
            raise Stale(f"{self.name} does not come from a data set")
        made, wanted = json.loads(str(text)), json.loads(self.identity)
        lacking = [name for name in self.sensors if name not in made["sensors"]]
        if set(made["sensors"]) < set(self.sensors):
            made["sensors"] = wanted["sensors"]
        for key, value in wanted.items():
            if made.get(key) != value:
                raise Stale(f"{self.name} has {key} {_short(made.get(key))}, now {_short(value)}")
        return lacking if frames == self.frames else None

    def make(self, folder: Path, progress: Callable[[int, int], None] | None = None) -> str:
        """Simulate the recording, or only the sensors that it lacks. The file gets its name when it is whole.

        Args:
            folder: folder of the data set.
            progress: called with (frames done, total frames).

        Returns:
            Statistics of the motion in one line.

        Raises:
            InputError: with the task's name in the message.
        """
        from radarize.learning.features.keeping import keep_maps
        from radarsim.machine.threads import share_with_drjit
        from radarsim.motion.statistics import Statistics
        from radarsim.recording.add_sensors import add_sensors
        from radarsim.recording.batches import Batches
        from radarsim.recording.simulate import record

        share_with_drjit()
        final, late = self.path(folder), None
        with suppress(Stale):
            late = self._lacking(folder)
        try:
            scenario, cfg_text, about = self._scenario()
            about |= self.attributes | {ATTRIBUTE: self.identity}
            if late:
                add_sensors(final, scenario, late, about, progress)
            else:
                path = final if self.storage == "raw" else final.with_name(f"{final.name}.raw.part")
                batches = Batches.of(scenario)
                if (frames := len(batches.times)) < self.frames:
                    raise InputError(
                        f"the way-points are reached after {frames} of {self.frames} frames, expected a longer path"
                    )
                record(batches, path, cfg_text=cfg_text, attributes=about, progress=progress)
                if path != final:
                    keep_maps(path, final)
            self.clear(folder)
            with Recording(final) as recording:
                moved = Statistics.from_json(str(recording.attributes["motion"]))
        except InputError as error:
            raise InputError(f"{self.name}: {error}") from error
        return str(moved)

    def _scenario(self):
        """See `radarsim.recording.simulate.planned`."""
        from radarsim.recording.simulate import planned
        from radarsim.world.scene import Scene

        drawn = {name: value for name, value in self.randomised.items() if name not in OF_SENSOR}
        if isinstance(self.scene, str):
            scene = Scene.load(self.scene, drawn)
            mild = Scene.load(split_level(self.scene)[0], drawn) if self.variant.level else scene
        else:
            scene = mild = Scene.of(self.scene | drawn, self._place)
        radar = self.variant.radar_of(self.radar)
        return planned(
            scene, walk_in=mild, seed=self.seed, radar=radar, sensors=self.sensors, people=self.people,
            frontend=self.variant.frontend_of(self.frontend, load_config(radar)[0].board),
            platform=self.platform, duration=self.duration,
            mounting=self.variant.mounted or mounting(self.randomised, self.platform),
            waypoints=None if self.waypoints is None else np.array(self.waypoints),
        )  # fmt: skip

    def clear(self, folder: Path) -> None:
        """Remove temporary files of this recording, left by this run or an interrupted one."""
        path = self.path(folder)
        for suffix in _LEFTOVERS:
            path.with_name(path.name + suffix).unlink(missing_ok=True)

    @property
    def _place(self) -> str:
        return self.building if self.floor is None else f"{self.building}_{self.floor}"


def content(scene: dict | str) -> dict[str, object] | None:
    """Name and digest of a scene's file, and digests of its meshes by name; None: the scene has no file.

    Raises:
        InputError: a file cannot be read.
    """
    if isinstance(scene, dict):
        return None
    file = Path(split_level(scene)[0])
    parts = {part.name: _digest(part) for part in meshes(file)}
    return {"file": Path(scene).name, "sha256": _digest(file)} | ({"meshes": parts} if parts else {})


def _digest(path: Path) -> str:
    with explained(f"{path}: cannot be read", OSError):
        return sha256(path.read_bytes()).hexdigest()


def _short(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
