"""Reader of a run folder. A damaged file raises one sentence, and cannot make it allocate more memory than the file has
bytes."""

import json
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields
from functools import cached_property
from pathlib import Path

import h5py
import numpy as np
from jaxtyping import Float
from pydantic import TypeAdapter, ValidationError

from radarize.io.errors import InputError, explained
from radarize.io.files import regular
from radarize.io.hdf5 import dataset, open_hdf5
from radarize.io.jsonfile import read_json
from radarize.io.plain import format_validation_error
from radarize.io.replacing import write_whole
from radarize.io.tum import read_tum
from radarize.odometry.observability import UnobservableSpans
from radarize.odometry.uncertainty import ErrorModel
from radarize.pipeline.health import Condition
from radarize.pipeline.runfolder.occupancy import OccupancyMap

#: Times (s) and poses (position m, quaternion x y z w).
Poses = tuple[Float[np.ndarray, "pose"], Float[np.ndarray, "pose 7"]]
#: Data sets of ``scans.h5``: names of their axes; axes of the same name have equal length; "2+" is two or more.
SHAPES = {
    "time": "scan",
    "azimuths": "beam",
    "ranges": "scan beam",
    "frames": "scan",
    "velocity": "scan 2+",
    "velocity_covariance": "scan 2 2",
    "velocity_seen": "scan",
    "turn_seen": "scan",
    "errors/duration": "scan",
    "errors/noise": "scan 3 3",
    "errors/correlation": "scan 2",
    "errors/variance": "scan 3 3",
    "trajectory_covariance": "pose 3 3",
    "truth/velocity": "scan 2+",
    "truth/scan": "scan true_beam",
    "truth/scan_azimuths": "true_beam",
    "truth/floor_plan": "segment 4",
    "truth/time": "truth",
    "truth/pose": "truth 7",
    "heatmaps/frames": "picture",
    "heatmaps/ranges": "range",
    "heatmaps/azimuths": "azimuth",
    "heatmaps/velocities": "speed",
    "heatmaps/range_azimuth": "picture range azimuth",
    "heatmaps/elevation_aware": "picture range azimuth",
    "heatmaps/doppler_azimuth": "picture speed azimuth",
}
#: Files of a run; a complete run has the first.
FILES = (
    *("trajectory.tum", "odometry.tum", "reference.tum", "map.pgm", "map.yaml", "scans.h5", "run.json"),
    "metrics.json",
)
_NEEDED = ("time", "ranges", "azimuths")
#: Key of ``run.json`` for the spans in which the motion was unobservable.
_SPANS = "blind"
#: Data sets with the times and coordinates of the others.
_AXES = ("time", "azimuths", "truth/scan_azimuths", "heatmaps/ranges", "heatmaps/azimuths", "heatmaps/velocities")
#: Factor by which a data set of ``scans.h5`` may be compressed, and bytes that may be missing. Ours are not compressed.
_PACKED, _AHEAD = 20, 1 << 20


class RunFolder:
    """Reader of a run folder; every file is read once, on first access.

    Raises:
        InputError: not a run folder, or an incomplete one.
    """

    def __init__(self, path: str | Path):
        self.path = Path(path)
        if not self.has("trajectory.tum"):
            raise InputError(f"{self.path}: has no trajectory.tum, expected a folder that radarize run wrote")

    def has(self, name: str) -> bool:
        """Return whether there is a file of this name."""
        return (self.path / name).is_file()

    @cached_property
    def facts(self) -> dict[str, object]:
        """Content of ``run.json``; empty without it."""
        return read_json(self.path / "run.json")

    @property
    def methods(self) -> dict[str, str]:
        """Names of the methods, with keys ``odometry`` and ``scans``; empty if unknown.

        Raises:
            InputError: ``run.json`` is damaged.
        """
        found = self.facts.get("methods", {})
        if not isinstance(found, dict):
            raise InputError(f"{self.path / 'run.json'}: methods is {str(found)[:60]!r}, expected an object")
        return {name: str(value) for name, value in found.items()}

    @property
    def warnings(self) -> list[str]:
        """Warnings in ``run.json``.

        Raises:
            InputError: ``run.json`` is damaged.
        """
        found = self.facts.get("warnings", [])
        if not isinstance(found, list):
            raise InputError(f"{self.path / 'run.json'}: warnings is {str(found)[:60]!r}, expected a list")
        return [str(words) for words in found]

    @property
    def unobservable_spans(self) -> UnobservableSpans | None:
        """Spans in which odometry could not observe the motion, s since the first pose; None if ``run.json`` has none.

        Raises:
            InputError: the entry is malformed.
        """
        if _SPANS not in self.facts:
            return None
        try:
            found = UnobservableSpans.model_validate(self.facts[_SPANS])
        except ValidationError as error:
            raise InputError(f"{self.path / 'run.json'}: {_SPANS}.{format_validation_error(error)}") from error
        start = float(self.trajectory[0][0])
        for span in found.spans:
            span.start_s, span.stop_s = span.start_s - start, span.stop_s - start
        return found

    @property
    def health(self) -> list[Condition]:
        """Conditions that degraded odometry, s since the first pose; empty if ``run.json`` has none.

        Raises:
            InputError: the entry is malformed.
        """
        try:
            found = TypeAdapter(list[Condition]).validate_python(self.facts.get("health", []))
        except ValidationError as error:
            raise InputError(f"{self.path / 'run.json'}: health.{format_validation_error(error)}") from error
        start = float(self.trajectory[0][0])
        for each in found:
            each.start_s, each.stop_s = each.start_s - start, each.stop_s - start
        return found

    @cached_property
    def trajectory(self) -> Poses:
        """Poses of SLAM."""
        return read_tum(self.path / "trajectory.tum")

    @cached_property
    def odometry(self) -> Poses | None:
        """Poses of odometry; None without odometry."""
        return self._poses("odometry.tum")

    @cached_property
    def reference(self) -> Poses | None:
        """True poses; None if unknown."""
        return self._poses("reference.tum")

    def _poses(self, name: str) -> Poses | None:
        return read_tum(self.path / name) if self.has(name) else None

    @cached_property
    def scans(self) -> "Scans":
        """Data sets of ``scans.h5``; empty without it."""
        return Scans(self.path / "scans.h5") if self.has("scans.h5") else Scans()

    @cached_property
    def errors(self) -> ErrorModel | None:
        """Error model of odometry at every scan; None if unknown."""
        names = [f"errors/{each.name}" for each in fields(ErrorModel)]
        return ErrorModel(*(self.scans[name] for name in names)) if self.scans.keys() >= {*names} else None

    @cached_property
    def map(self) -> OccupancyMap | None:
        """Map of SLAM; None without it."""
        return OccupancyMap.read(self.path / "map.yaml") if self.has("map.yaml") else None

    @property
    def metrics(self) -> dict[str, object]:
        """Content of ``metrics.json``; empty without it."""
        return read_json(self.path / "metrics.json")

    def write_metrics(self, metrics: Mapping[str, object]) -> None:
        """Write ``metrics.json``.

        Raises:
            InputError: it cannot be written.
        """
        write_whole(self.path / "metrics.json", json.dumps(metrics, indent=2) + "\n")


def _declared(file: h5py.File, name: str) -> h5py.Dataset:
    return dataset(file, name, Path(file.filename), _PACKED, _AHEAD)


class Scans(Mapping[str, np.ndarray]):
    """Data sets of a run's ``scans.h5`` by path, each read on first access.

    Args:
        path: the file; None for a run without scans.

    Raises:
        InputError: unreadable, without times, ranges and azimuths, or with data sets that do not fit each other or
            that declare more bytes than the file has.
    """

    def __init__(self, path: Path | None = None):
        self.path = path
        self._known: dict[str, np.ndarray] = {}
        self._lengths: dict[str, int] = {}
        self._names: list[str] = []
        if path is None:
            return
        regular(path, "the scans of a run")
        with self._open() as file:
            file.visititems(lambda name, item: self._names.append(name) if isinstance(item, h5py.Dataset) else None)
            for name in _NEEDED:
                if name not in self._names:
                    raise InputError(f"{path}: has no /{name}, expected /time, /ranges and /azimuths")
            # The length of an axis is that of the first data set in the order above that has it.
            for name in [name for name in SHAPES if name in self._names]:
                self._check(name, _declared(file, name))

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self._known:
            if name not in self._names:
                raise KeyError(name)
            with self._open() as file:
                data = _declared(file, name)
                rows = slice(self._lengths["scan"]) if SHAPES.get(name, "").startswith("scan") else ...
                values = data[rows]
            if name in _AXES and not np.isfinite(values).all():
                raise InputError(f"{self.path}: /{name} holds numbers that are not finite")
            self._known[name] = values
        return self._known[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def copy(self, file: h5py.File, without: Collection[str]) -> None:
        """Copy the data sets into another file, except for some."""
        with self._open() as source:
            for name in self._names:
                if name not in without:
                    _declared(source, name)
                    source.copy(name, file, name)

    @contextmanager
    def _open(self) -> Iterator[h5py.File]:
        assert self.path is not None  # without a file there are no names
        with explained(f"{self.path}: is no readable HDF5 file"), open_hdf5(self.path) as file:
            yield file

    def _check(self, name: str, data: h5py.Dataset) -> None:
        """Raise InputError unless a data set has the expected axes, with the lengths that other data sets have."""
        axes = SHAPES[name].split()
        fits = len(axes) == data.ndim and data.dtype.kind != "c"
        for axis, length in zip(axes, data.shape, strict=False):
            if axis[0].isdigit():
                fits &= length == int(axis[0]) or (axis.endswith("+") and length > int(axis[0]))
            else:
                known = self._lengths.setdefault(axis, length)
                # Truth that was written beyond the last complete frame is cut.
                fits &= length == known or (axis == "scan" and name.startswith("truth/") and length > known)
        if not fits:
            expected = " x ".join(str(self._lengths.get(axis, axis)) for axis in axes)
            raise InputError(
                f"{self.path}: /{name} has shape {data.shape} of {data.dtype}, expected {expected}, {SHAPES[name]}"
            )
