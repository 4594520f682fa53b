"""SLAM on plain files: scans and odometry of any sensor in, a run folder out."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from radarize.io.errors import InputError
from radarize.io.files import regular
from radarize.io.npyfile import read_npz
from radarize.io.tum import planar, planar_poses, read_tum
from radarize.odometry.uncertainty import ErrorModel
from radarize.pipeline.runfolder import RunFolder, RunWriter
from radarize.slam.backend import Slam
from radarize.slam.config import SlamConfig

#: Arrays of the ``.npz``; times are optional.
_FIELDS = ("ranges", "angle_min", "angle_increment", "range_max", "times")


@dataclass(frozen=True)
class Log:
    """Scans of any sensor, with odometry if available.

    Attributes:
        times: times of the scans, s, in any order.
        azimuths: azimuths of the beams, rad, positive to the left.
        ranges: m; inf: no echo; nan: unknown.
        odometry_times, odometry: times, s, and poses: x, y (m) and yaw (rad).
        errors: error model of the odometry's steps; None if unknown.
    """

    times: Float[np.ndarray, "scan"]
    azimuths: Float[np.ndarray, "beam"]
    ranges: Float[np.ndarray, "scan beam"]
    odometry_times: Float[np.ndarray, "pose"]
    odometry: Float[np.ndarray, "pose 3"]
    errors: ErrorModel | None = None

    @classmethod
    def read(cls, scans: Path, odometry: Path | None = None) -> "Log":
        """Read scans and odometry from files.

        Args:
            scans: a ``.npz`` with ``ranges`` (scan, beam) in m, ``range_max`` in m (ranges from there on mean no
                echo), ``angle_min`` and ``angle_increment`` in rad (positive to the left), and ``times`` (scan,) in
                s; without times, scan i has the time i s. Or a run folder, whose ``scans.h5`` is read.
            odometry: TUM file; by default the ``odometry.tum`` of a run folder.

        Raises:
            InputError: a file or field is missing or malformed.
        """
        scans, moved, errors = Path(scans), read_tum(odometry) if odometry else None, None
        if scans.is_dir():
            run = RunFolder(scans)
            moved = moved or run.odometry
            if not run.scans:
                raise InputError(f"{scans}: has no scans.h5, expected a run with scans")
            times, azimuths, ranges = (run.scans[name].astype(float) for name in ("time", "azimuths", "ranges"))
            errors = run.errors
        else:
            times, azimuths, ranges = _npz_scans(scans)
        if moved is None:
            return cls(times, azimuths, ranges, np.zeros(0), np.zeros((0, 3)))
        stamps, poses = moved
        if errors is not None and len(errors) != len(stamps):
            errors = None  # they belong to other odometry
        return cls(times, azimuths, ranges, stamps, planar(poses), errors)

    def feed(self, slam: Slam, progress: Callable[[int, int], None] = lambda done, total: None) -> None:
        """Add all scans and odometry to a new session in order of time and finish it; call `progress` with (done,
        total)."""
        errors = self.errors if self.errors is not None else [None] * len(self.odometry_times)
        odometry = deque(zip(self.odometry_times, self.odometry, errors, strict=True))
        for done, i in enumerate(np.argsort(self.times, kind="stable"), 1):
            while odometry and odometry[0][0] <= self.times[i]:
                slam.add_odometry(*odometry.popleft())
            slam.add_scan(self.times[i], self.azimuths, self.ranges[i])
            progress(done, len(self.times))
        for entry in odometry:
            slam.add_odometry(*entry)
        slam.finish()


def run(
    scans: Path,
    odometry: Path | None,
    output: Path,
    *,
    config: SlamConfig,
    reference: Path | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Path:
    """Run SLAM on plain files.

    Args:
        scans, odometry: as in `Log.read`.
        output: folder to write: trajectory.tum (a pose for every scan), odometry.tum, map.pgm and map.yaml,
            scans.h5, run.json, and reference.tum if there is a reference. `radarize evaluate` and `radarize report`
            read it.
        config: settings of the back end.
        reference: TUM file of true poses; by default the ``reference.tum`` of a run folder.
        progress: called with (scans done, scans in all).

    Raises:
        InputError: unusable input, or the folder cannot be written.
    """
    scans, output = Path(scans), Path(output)
    if scans.is_dir() and output.resolve() == scans.resolve():
        raise InputError(f"{output}: is the input run, expected another folder to write")
    log, truth = Log.read(scans, odometry), None if reference is None else read_tum(reference)
    source = RunFolder(scans) if scans.is_dir() else None
    if truth is None and source is not None:
        truth = source.reference
    slam = Slam(config)
    log.feed(slam, progress)
    with RunWriter(output) as writer:
        if source is not None:
            writer.inherit(source.scans, without=("trajectory_covariance",))
        else:
            writer.put("time", log.times, "s")
            writer.put("azimuths", log.azimuths, "rad")
            writer.put("ranges", log.ranges, "m")
        if len(log.odometry):
            writer.write_poses("odometry", (log.odometry_times, planar_poses(log.odometry)))
        if truth is not None:
            writer.write_poses("reference", truth)
        named = None if odometry is None else Path(odometry).name
        return writer.finish(slam, {"scans": scans.name, "odometry": named, "slam_settings": config.model_dump()})


def _npz_scans(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    regular(path, "scans (.npz) or the folder of a run")
    arrays = read_npz(path, str(path), _FIELDS, path.stat().st_size)
    found = {name: np.asarray(array, float) for name, array in arrays.items()}
    for name in _FIELDS[:4]:
        if name not in found:
            raise InputError(f"{path}: has no {name}, expected ranges, angle_min, angle_increment and range_max")
    ranges = found["ranges"]
    if ranges.ndim != 2:
        raise InputError(f"{path}: ranges has shape {ranges.shape}, expected (scan, beam)")
    for name in ("angle_min", "angle_increment", "range_max"):
        if found[name].size != 1 or not np.isfinite(found[name]).all():
            raise InputError(f"{path}: {name} is {found[name].tolist()}, expected one finite number")
    times = found.get("times", np.arange(float(len(ranges))))
    if times.shape != ranges.shape[:1] or not np.isfinite(times).all():
        raise InputError(f"{path}: times has shape {times.shape}, expected {ranges.shape[:1]} finite seconds")
    with np.errstate(over="ignore"):  # rejected where they are used
        azimuths = found["angle_min"].item() + found["angle_increment"].item() * np.arange(ranges.shape[1])
    return times, azimuths, np.where(ranges >= found["range_max"].item(), np.inf, ranges)
