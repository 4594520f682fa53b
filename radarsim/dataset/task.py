"""One recording of a data set: what it must be, whether it is there already, and how it is made."""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path

from radarize import __version__
from radarize.errors import InputError
from radarize.recording import Recording

#: Attribute of a recording that holds its task's parameters.
ATTRIBUTE = "task"
#: What a killed run may leave beside a recording: samples of it, or those that its heat maps are made from.
_LEFTOVERS = (".part", ".raw.part", ".raw.part.part")


class Stale(InputError):
    """A recording that was made with other parameters."""


@dataclass(frozen=True)
class Task:
    """One recording to make.

    Attributes:
        name: of the recording, without suffix.
        building, floor: as in the specification.
        platform: how the sensor moves.
        scene: a scene's description, or the path of its file.
        duration: s.
        frames: that the recording will have.
        seed: of tour, scatterers and noise.
        radar: preset or configuration file.
        frontend: front-end file; None for the default.
        settings: digest of what these two hold.
        sensors: truth sensors.
        storage: ``raw`` or ``heatmaps``.
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

    @property
    def parameters(self) -> dict[str, object]:
        """Everything that decides the recording's bytes; files by their content, so that they may move."""
        found = asdict(self) | {"sensors": list(self.sensors), "version": __version__}
        for field in ("radar", "frontend"):
            found[field] = found[field] and Path(found[field]).name
        if isinstance(self.scene, str):
            found["scene"] = {"file": Path(self.scene).name, "sha256": _digest(Path(self.scene))}
        return found

    def path(self, folder: Path) -> Path:
        """Where the recording lies."""
        return folder / f"{self.name}.h5"

    def is_finished(self, folder: Path) -> bool:
        """Whether the recording is there and whole.

        Raises:
            Stale: it is, but was made with other parameters, or is no recording of a data set.
        """
        path = self.path(folder)
        if not path.is_file():
            return False
        try:
            with Recording(path) as recording:
                frames, made = len(recording), recording.attributes.get(ATTRIBUTE)
        except InputError:
            return False  # cut short or damaged
        if made is None:
            raise Stale(f"{self.name} does not come from a data set")
        made = json.loads(str(made))
        for field, wanted in json.loads(json.dumps(self.parameters)).items():
            if made.get(field) != wanted:
                raise Stale(f"{self.name} has {field} {_short(made.get(field))}, now {_short(wanted)}")
        return frames == self.frames

    def make(self, folder: Path, progress: Callable[[int, int], None] | None = None) -> dict[str, float]:
        """Simulate the recording; it appears under its name when it is whole.

        Returns:
            statistics of its motion.

        Raises:
            InputError: with the task's name.
        """
        from radarize.training.maps import keep_maps
        from radarsim.scene.scene import Scene
        from radarsim.simulate import simulate

        final = self.path(folder)
        path = final if self.storage == "raw" else final.with_name(f"{final.name}.raw.part")
        try:
            scene = Scene.load(self.scene) if isinstance(self.scene, str) else Scene.of(self.scene, self._place)
            simulate(
                scene,
                path,
                platform=self.platform,
                duration=self.duration,
                seed=self.seed,
                radar=self.radar,
                frontend=None if self.frontend is None else Path(self.frontend),
                sensors=self.sensors,
                attributes={ATTRIBUTE: json.dumps(self.parameters, sort_keys=True)},
                progress=progress,
            )
            with Recording(path) as recording:
                statistics = motion_statistics(recording)
            if path != final:
                keep_maps(path, final)
        except InputError as error:
            raise InputError(f"{self.name}: {error}") from error
        finally:
            if path != final:
                path.unlink(missing_ok=True)
        return statistics

    def clear(self, folder: Path) -> None:
        """Remove what a killed run left half-written."""
        for suffix in _LEFTOVERS:
            path = self.path(folder)
            path.with_name(path.name + suffix).unlink(missing_ok=True)

    @property
    def _place(self) -> str:
        return self.building if self.floor is None else f"{self.building}_{self.floor}"


def _digest(path: Path) -> str:
    try:
        return sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error


def _short(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def motion_statistics(recording: Recording) -> dict[str, float]:
    """Distance (m), mean speed and top speed (m/s) of a recording's truth."""
    import numpy as np

    steps = np.linalg.norm(np.diff(recording.read("truth/pose")[:, :3], axis=0), axis=1)
    speed = np.linalg.norm(recording.read("truth/velocity")[:, :3], axis=1)
    return {"distance": float(steps.sum()), "mean speed": float(speed.mean()), "top speed": float(speed.max())}
