"""Run the whole pipeline on a recording."""

import shutil
import tempfile
import weakref
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
import xarray

from radarize.io.alignment import fitted, moved
from radarize.io.canvas import axes_or_new, png
from radarize.io.errors import InputError, explained
from radarize.io.load import Source, frames_of
from radarize.io.replacing import Replacement
from radarize.io.trajectory import Trajectory
from radarize.io.tum import planar
from radarize.pipeline.config import Configuration
from radarize.pipeline.methods import choose_methods
from radarize.pipeline.odometry import configuration
from radarize.pipeline.runfolder import OccupancyMap, RunFolder
from radarize.pipeline.runfolder.reader import FILES
from radarize.pipeline.session import run_recording
from radarize.signal.polar import pictured

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Run:
    """Result of the pipeline on a recording; each part is read on first access.

    Args:
        path: folder that `run` or ``radarize run`` wrote.

    Attributes:
        path: the folder; a temporary one is deleted with the object.
        folder: reader of its files, for programs that need them.

    Raises:
        InputError: not a run folder, or an incomplete one.

    Example:
        >>> run = rz.Run("RUN")
        >>> run.methods["odometry"]
        'doppler'
    """

    def __init__(self, path: str | Path):
        self.folder = RunFolder(path)
        self.path = self.folder.path

    def __repr__(self) -> str:
        made = ", ".join(f"{name} {value}" for name, value in self.methods.items())
        return f"<run of {self.facts.get('recording', 'scans')}: {self.trajectory!r}; {made}>"

    @cached_property
    def trajectory(self) -> Trajectory:
        """Trajectory of SLAM, a pose for each scan; the first pose is near the origin."""
        time, pose = self.folder.trajectory
        return Trajectory(time, pose, self.folder.scans.get("trajectory_covariance"), name="SLAM")

    @cached_property
    def odometry(self) -> Trajectory | None:
        """Trajectory of odometry alone, with velocities; None if the run has none."""
        if (found := self.folder.odometry) is None:
            return None
        time, pose = found
        scans, errors = self.folder.scans, self.folder.errors
        return Trajectory(
            time, pose, None if errors is None else errors.since_start(planar(pose)), scans.get("velocity"),
            scans.get("velocity_covariance"), name="odometry",
        )  # fmt: skip

    @cached_property
    def truth(self) -> Trajectory | None:
        """True poses, with the floor plan if it is known; None without truth."""
        if (found := self.folder.reference) is None:
            return None
        return Trajectory(*found, floor_plan=self.folder.scans.get("truth/floor_plan"), name="truth")

    @cached_property
    def map(self) -> OccupancyMap | None:
        """Occupancy map, in the frame of `trajectory`."""
        return self.folder.map

    @cached_property
    def scans(self) -> xarray.DataArray:
        """Ranges (time, azimuth) in m, inf: no echo; ``time`` s, ``azimuth`` rad, positive to the left.

        Raises:
            InputError: the run has no scans.
        """
        scans = self.folder.scans
        if "ranges" not in scans:
            raise InputError(f"{self.path}: has no scans.h5, expected a run with scans")
        axes = {
            "time": ("time", scans["time"], {"units": "s"}),
            "azimuth": ("azimuth", scans["azimuths"], {"units": "rad"}),
        }
        return xarray.DataArray(scans["ranges"], axes, ("time", "azimuth"), "range", {"units": "m"})

    @property
    def facts(self) -> dict[str, object]:
        """Content of ``run.json``: recording, settings, versions, timings."""
        return self.folder.facts

    @property
    def methods(self) -> dict[str, str]:
        """Names of the methods, with keys ``odometry`` and ``scans``."""
        return self.folder.methods

    @property
    def warnings(self) -> list[str]:
        """Warnings of the pipeline, such as unobservable motion."""
        return self.folder.warnings

    def save(self, folder: str | Path) -> Path:
        """Copy the run to a folder, replacing an existing one: trajectories (TUM), ROS map, scans (HDF5), ...

        Raises:
            InputError: it cannot be written.
        """
        if Path(folder).resolve() != self.path.resolve():
            files = Replacement(Path(folder), FILES)
            try:
                with explained(f"{folder}: cannot be written", OSError):
                    for name in filter(self.folder.has, FILES):
                        shutil.copyfile(self.path / name, files.part / name)
                files.place()
            finally:
                files.discard()
        return Path(folder)

    def plot(self, axes: "Axes | None" = None, *, truth: Trajectory | None = None) -> "Axes":
        """Draw trajectories and map from above, in m; a `truth`, such as ``rec.truth``, is aligned and drawn with them.

        Raises:
            InputError: fewer than three poses of the truth match.
        """
        axes = axes_or_new(axes)
        turn, shift = np.eye(3), np.zeros(3)
        if truth is not None:
            turn, shift = fitted(self.trajectory.to_evo(), truth.to_evo())
            truth.plot(axes, color="0.3", linestyle="--")
        if (grid := self.map) is not None:
            cells = grid.centers(grid.occupied) @ turn[:2, :2].T + shift[:2]
            axes.plot(*cells.T, "s", markersize=1.5, color="tab:purple", label="map")
        for each in (self.odometry, self.trajectory):
            if each is not None:
                path = moved(each.to_evo(), turn, shift).positions_xyz
                axes.plot(path[:, 0], path[:, 1], label=each.name)
        axes.set(xlabel="x, m", ylabel="y, m", aspect="equal")
        axes.legend()
        return axes

    def _repr_png_(self) -> bytes:
        return png(lambda axes: self.plot(axes, truth=self.truth))


def run(
    recording: Source,
    output: str | Path | None = None,
    *,
    odometry: str | None = None,
    scans: str | None = None,
    settings: Literal["corrected", "published"] = "corrected",
    weights: str | Path | None = None,
    config: Configuration | str | Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Run:
    """Estimate trajectory and map of a recording: odometry, scans, SLAM.

    Args:
        recording: a recording or a file, or a part of one: ``rec[:300]``, every second frame ``rec[::2]``.
        output: folder to write: trajectory.tum (SLAM), odometry.tum, reference.tum (if there are true poses), map.pgm
            and map.yaml (ROS), scans.h5, run.json. By default a temporary one, see `Run.save`.
        odometry, scans: methods by name; by default networks where they fit the radar, else the classical ones.
        settings: variant of the paper's method: ``"published"`` is ``odometry="published", scans="published"``.
        weights: folder with network weights; by default the shipped ones.
        config: pipeline settings, or a YAML file of them (``radarize config`` prints all).
        progress: called with (frames done, frames in all).

    Returns:
        ``.trajectory``, ``.odometry``, ``.map``, ``.scans``, ``.save(folder)``, ``.plot(truth=rec.truth)``.

    Raises:
        InputError: an unusable recording, or an unknown method.

    Example:
        >>> run = rz.run(rec, odometry="doppler", scans="first-echo")
        >>> len(run.trajectory), dict(run.scans.sizes)
        (24, {'time': 24, 'azimuth': 88})
        >>> run.save("RUN").name
        'RUN'
    """
    if settings not in ("corrected", "published"):
        raise InputError(f"settings is {settings!r}, expected corrected or published")
    if settings == "published":
        for name, value in (("odometry", odometry), ("scans", scans)):
            if value not in (None, "published"):
                raise InputError(f"--{name} is {value!r}, expected none with --settings published, which has its own")
        odometry = scans = "published"
    frames = frames_of(recording)
    methods, why = choose_methods(
        frames.config, odometry, scans, own_weights=bool(weights), pictures=pictured(frames.recording)
    )
    place = Path(tempfile.mkdtemp(prefix="radarize-") if output is None else output)
    try:
        run_recording(
            frames, place, methods, weights=weights, configuration=configuration(config),
            facts={"no networks": why} if why else None, progress=progress or (lambda done, total: None),
        )  # fmt: skip
        made = Run(place)
    except BaseException:
        if output is None:
            shutil.rmtree(place, ignore_errors=True)
        raise
    if output is None:
        weakref.finalize(made, shutil.rmtree, place, ignore_errors=True)
    return made
