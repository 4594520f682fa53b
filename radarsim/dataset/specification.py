"""A data set is specified by a YAML file, which stands for a list of recordings.

    name: two-floors
    seed: 1
    buildings:
      A: {kind: A, seed: 3}            # as `building` in a scene file; `floors` below picks a floor
      B: {kind: B, seed: 3, clutter: 1, unevenness: 1}                  # both as in a scene file, and interferers too
      C: {kind: C, seeds: [101, 108]}  # eight buildings, C101 to C108
      shop: shop.yaml                  # a scene of the project, or a scene file beside this one
    recordings:
      - {building: A, floors: [0, 1], platform: handheld, count: 15, duration: 60}
      - {building: shop, platform: [cart, robot], count: 2, duration: 20, people: 3, variants: [plain]}
      - {building: C*, platform: cart, count: 1, duration: 40, by_turns: true}  # C101 plain, C102 coarse, ...
    radar: radarize                    # preset or .cfg file
    frontend: board.yaml               # as `radarsim calibrate` writes it; the board's own by default
    sensors: [depth, imu]              # or all, or none
    storage: raw                       # or heatmaps: heat maps without samples, for training
    variants:                          # every recording once for each, with the same seed and walk
      plain: {}
      coarse: {radar: {samples: 48}, attributes: {value: 48}}             # see `radarsim.dataset.variant`
    randomise:                         # drawn per recording; default: the range of real rooms; {}: nothing
      clutter: {uniform: [0.7, 1.4]}                                    # see `radarsim.dataset.randomise`
    splits:
      random: {kind: random, folds: 5}                                  # random-0 ... random-4
      platform: {kind: platform, train: [handheld]}                     # tested on all others
      building: {kind: building, held_out: [A, shop]}                   # building-A, building-shop

The name of a recording is BUILDING_FLOOR_PLATFORM_NUMBER, with _VARIANT where there are variants. Its seed depends only
on the data set's seed and on the name without the variant: a recording is the same in any order of simulation and with
any other recordings beside it. ``waypoints`` ([[x, y], ...], m) replace the planned tour. ``attributes`` of the data
set, of recordings or of a variant become attributes of the files.
"""

import fnmatch
import hashlib
from collections import Counter
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, ValidationError, field_validator, model_validator

from radarize.io.errors import InputError
from radarize.io.files import within
from radarize.io.plain import Frozen
from radarize.io.yamlfile import read_yaml
from radarize.radar.config import RadarConfig
from radarize.radar.limits import check_limits
from radarize.radar.presets import load_config
from radarsim.dataset.fields import OF_SCENE, Place, SensorName
from radarsim.dataset.randomise import OF_SENSOR, Platform, Randomise
from radarsim.dataset.splits import Split
from radarsim.dataset.task import Task, content
from radarsim.dataset.variant import Attributes, Variant
from radarsim.world.description import described, description_model, find, shipped, split_level
from radarsim.world.validation import format_validation_error

#: Recordings that a data set may stand for: a count with a digit too many takes all memory.
MOST = 20_000
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9-]+$")]


class Recordings(Frozen):
    """A group of recordings in one building.

    Attributes:
        building: name in `buildings`, or a pattern of several names (* and ?).
        floors: floors that the recordings use in turn; none for buildings without floors.
        platform: platform, or several with `count` recordings each.
        count: number of recordings per platform.
        duration: length of each recording, s.
        waypoints: way-points x, y instead of a planned tour, m.
        people: number of pedestrians near the radar's path.
        variants: names in `variants`; default: all.
        by_turns: use one variant per matching building, in turn, instead of all.
        attributes: attributes of the files.
    """

    building: Annotated[str, Field(pattern=r"^[A-Za-z0-9*?!\[\]-]+$")]
    floors: tuple[Annotated[int, Field(ge=0)], ...] = ()
    platform: Platform | tuple[Platform, ...]
    count: int = Field(gt=0)
    duration: float = Field(gt=0)
    waypoints: Annotated[tuple[tuple[float, float], ...], Field(min_length=2)] | None = None
    people: int = Field(0, ge=0, le=50)
    variants: tuple[Name, ...] = ()
    by_turns: bool = False
    attributes: Attributes = {}

    @property
    def platforms(self) -> tuple[str, ...]:
        return (self.platform,) if isinstance(self.platform, str) else self.platform

    def each(self, count: Counter) -> Iterator[tuple[str, str, int | None]]:
        """Name, platform and floor of each recording; `count` counts the recordings by place and platform."""
        for platform in self.platforms:
            for k in range(self.count):
                floor = self.floors[k % len(self.floors)] if self.floors else None
                place = self.building if floor is None else f"{self.building}_{floor}"
                yield f"{place}_{platform}_{count[place, platform]:02d}", platform, floor
                count[place, platform] += 1


class Specification(Frozen):
    """A data set's specification; see the head of this file.

    Attributes:
        name: name of the data set.
        seed: seed of all recordings.
        buildings: buildings by name: a generated building, a scene of the project, or a scene file beside this one.
        recordings: groups of recordings.
        radar: preset or .cfg file.
        frontend: front-end file as `radarsim calibrate` writes it; default: the board's.
        sensors: sensors that are simulated beside the radar: names, all or none.
        storage: raw samples, or heat maps without samples for training.
        variants: variants of every recording by name; seed and trajectory are the same in each.
        attributes: attributes of the files.
        randomise: distributions of what differs between recordings; default: that of real rooms; {}: nothing.
        splits: splits into training, validation and test recordings, by name.
    """

    name: Name
    seed: int = Field(0, ge=0)
    buildings: dict[Name, Annotated[dict | str, Place()]] = Field(min_length=1)
    recordings: tuple[Recordings, ...] = Field(min_length=1)
    radar: str = "radarize"
    frontend: str | None = None
    sensors: tuple[Annotated[str, SensorName()], ...] | Literal["all", "none"] = "none"
    storage: Literal["raw", "heatmaps"] = "raw"
    variants: dict[Name, Variant] = {}
    attributes: Attributes = {}
    randomise: Randomise = Field(default_factory=Randomise.usual)
    splits: dict[Name, Split] = {}
    _folder: Path = Path()

    @field_validator("buildings", mode="before")
    @classmethod
    def _each_seed(cls, given: object) -> object:
        """Expand a building with `seeds`, first and last, to one building per seed."""
        if not isinstance(given, dict):
            return given
        found: dict[str, object] = {}
        for name, about in given.items():
            seeds = about.get("seeds") if isinstance(about, dict) else None
            if seeds is None:
                found[name] = about
                continue
            if not (isinstance(seeds, list) and len(seeds) == 2 and all(type(seed) is int for seed in seeds)):
                raise ValueError(f"seeds of {name} are {seeds}, expected [first, last]")
            if not 0 <= seeds[1] - seeds[0] < MOST:
                raise ValueError(f"seeds of {name} are {seeds}, expected [first, last], at most {MOST} of them")
            kept = {key: value for key, value in about.items() if key != "seeds"}
            found |= {f"{name}{seed}": {**kept, "seed": seed} for seed in range(seeds[0], seeds[1] + 1)}
        return found

    @model_validator(mode="after")
    def _each_building(self) -> "Specification":
        """Expand recordings with a pattern to those of each matching building."""
        groups: list[Recordings] = []
        for group in self.recordings:
            names = (
                [group.building] if group.building in self.buildings else fnmatch.filter(self.buildings, group.building)
            )
            turns = group.variants or tuple(self.variants)
            for k, name in enumerate(names or [group.building]):
                mine = {"variants": (turns[k % len(turns)],), "by_turns": False} if group.by_turns and turns else {}
                groups.append(group.model_copy(update={"building": name, **mine}))
        object.__setattr__(self, "recordings", tuple(groups))
        return self

    @model_validator(mode="after")
    def _consistent(self) -> "Specification":
        for number, group in enumerate(self.recordings):
            if group.building not in self.buildings:
                raise ValueError(
                    f"recordings[{number}].building is {group.building!r}, expected one of buildings: "
                    f"{', '.join(self.buildings)}"
                )
            if unknown := set(group.variants) - self.variants.keys():
                raise ValueError(
                    f"recordings[{number}].variants names {min(unknown)!r}, expected some of variants: "
                    f"{', '.join(self.variants) or 'there are none'}"
                )
            if group.floors and isinstance(self.buildings[group.building], str):
                raise ValueError(
                    f"recordings[{number}].floors is {list(group.floors)}, but building {group.building} is a scene "
                    "file, expected no floors"
                )
        return self

    @classmethod
    def load(cls, path: str | Path) -> "Specification":
        """Read a specification: a YAML file, or the name of one of the project (``small``).

        Raises:
            InputError: missing file, malformed YAML, an unknown key or a wrong value, with file and field.
        """
        path = _find(path)
        data = read_yaml(path)
        if not isinstance(data, dict):
            raise InputError(f"{path}: holds {type(data).__name__}, expected keys such as buildings and recordings")
        try:
            found = cls.model_validate(data)
            found._folder = path.parent
            for late in ("tasks", "members"):  # compute them now, so that their errors name the file
                getattr(found, late)
        except ValidationError as error:
            raise InputError(f"{path}: {format_validation_error(error, data)}") from error
        except InputError as error:
            raise InputError(f"{path}: {error}") from error
        return found

    @cached_property
    def tasks(self) -> tuple[Task, ...]:
        """One task for each recording, in the order of the file.

        Raises:
            InputError: a scene, radar or front-end file is missing or wrong.
        """
        radar = self._beside(self.radar)
        frontend = None if self.frontend is None else self._beside(self.frontend)
        sensors = self._sensors()
        variants = {f"_{key}": each.with_board(self._beside) for key, each in self.variants.items()} or {"": Variant()}
        made_in = [[f"_{key}" for key in group.variants] or list(variants) for group in self.recordings]
        total = sum(g.count * len(g.platforms) * len(keys) for g, keys in zip(self.recordings, made_in, strict=True))
        if total > MOST:
            raise InputError(f"recordings: stand for {total} recordings, expected at most {MOST}")
        settings = {key: self._settings(key, variant, radar, frontend) for key, variant in variants.items()}
        tasks: list[Task] = []
        count: Counter[str] = Counter()
        scenes: dict[tuple, tuple] = {}
        for number, group in enumerate(self.recordings):
            for name, platform, floor in group.each(count):
                seed = np.random.SeedSequence([self.seed, *name.encode()]).generate_state(1, np.uint64)[0]
                seed = int(seed >> np.uint64(1))
                for key in made_in[number]:
                    variant, (config, digest) = variants[key], settings[key]
                    place = group.building, floor, variant.level
                    if place not in scenes:
                        scene, fixed = self._scene(*place)
                        scenes[place] = scene, content(scene), fixed
                    scene, file, fixed = scenes[place]
                    frames = config.frames_within(group.duration)
                    if not frames:
                        raise InputError(
                            f"recordings[{number}].duration is {group.duration} s, expected at least one frame "
                            f"({config.burst_time:.4f} s)"
                        )
                    fixed = fixed | set(OF_SENSOR if variant.mounting else ())
                    tasks.append(
                        Task(
                            name=name + key, radar=radar, frontend=frontend, sensors=sensors, storage=self.storage,
                            building=group.building, floor=floor, platform=platform,
                            duration=group.duration, frames=frames, seed=seed, settings=digest,
                            waypoints=group.waypoints, people=group.people, variant=variant,
                            attributes=self.attributes | group.attributes | variant.attributes,
                            scene=scene, content=file, randomised=self.randomise.draw(seed, platform, fixed),
                        )
                    )  # fmt: skip
        return tuple(tasks)

    @cached_property
    def members(self) -> dict[str, dict[str, list[str]]]:
        """Names of the training, validation and test recordings of each split."""
        found: dict[str, dict[str, list[str]]] = {}
        for name, split in self.splits.items():
            rng = np.random.default_rng([self.seed, *name.encode()])
            try:
                found |= split.members(name, self.tasks, rng)
            except InputError as error:
                raise InputError(f"splits.{name}: {error}") from error
        return found

    def as_data(self) -> dict[str, object]:
        """The expanded specification as JSON-ready data."""
        return {
            "specification": self.model_dump(mode="json"),
            "recordings": {task.name: task.parameters for task in self.tasks},
            "splits": self.members,
        }

    def _settings(self, key: str, variant: Variant, radar: str, frontend: str | None) -> tuple[RadarConfig, str]:
        """Radar configuration of a variant, and a digest of it and its front end."""
        try:
            config, _ = load_config(variant.radar_of(radar))
            check_limits(config)
            settings = variant.frontend_of(frontend, config.board)
        except InputError as error:
            raise InputError(f"variants.{key[1:]}: {error}" if key else str(error)) from error
        return config, hashlib.sha256((config.model_dump_json() + settings.model_dump_json()).encode()).hexdigest()

    def _sensors(self) -> tuple[str, ...]:
        if not self.sensors or self.sensors == "none":
            return ()
        from radarsim.sensors.suite import chosen

        return tuple(chosen(["all"] if self.sensors == "all" else self.sensors))

    def _scene(self, building: str, floor: int | None, level: int) -> tuple[dict | str, set[str]]:
        """Scene of a recording, and the fields that are not drawn in it."""
        given = self.buildings[building]
        if isinstance(given, str):
            try:
                file = within(find(self._beside(given)), "it", self._folder, Path("scenes"), shipped()).resolve()
                level = level or split_level(given)[1]
                built = described(read_yaml(file), file.name, level).building
            except InputError as error:
                raise InputError(f"buildings.{building}: {error}") from error
            return f"{file}@{level}" if level else str(file), set() if built else {"furniture"}
        if level:
            raise InputError(f"buildings.{building}: is generated and has no levels, expected a scene file")
        settings = {key: given[key] for key in OF_SCENE if key in given}
        place = {} if floor is None else {"floor": floor}
        description = {"building": {key: given[key] for key in given if key not in OF_SCENE} | place} | settings
        try:
            description_model().model_validate(description)
        except ValidationError as error:
            raise InputError(
                f"buildings.{building}: {format_validation_error(error, description).removeprefix('building.')}"
            ) from error
        return description, set(given)

    def _beside(self, name: str) -> str:
        """Path of a file that the specification names: beside it if it exists there, else as it is."""
        beside = self._folder / name
        found = next((path for path in (beside, Path(name)) if path.is_file()), None)
        return name if found is None else str(within(found, "it", self._folder, Path("scenes"), shipped()).resolve())


def _find(path: str | Path) -> Path:
    given = Path(path)
    if given.is_file():
        return given
    folder = shipped() / "datasets"
    if given.suffix not in (".yaml", ".yml") and (named := folder / f"{given}.yaml").is_file():
        return named
    known = ", ".join(sorted(str(file.relative_to(folder).with_suffix("")) for file in folder.glob("**/*.yaml")))
    raise InputError(f"no specification {str(path)!r}, expected a .yaml file or one of: {known or 'none found'}")
