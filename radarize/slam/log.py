"""Plain files in and out: scans and odometry of any sensor, and the folder that a session leaves behind."""

import json
import shutil
import zipfile
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from jaxtyping import Float

from radarize import __version__
from radarize.errors import InputError
from radarize.replacing import replacing
from radarize.slam.backend import Slam
from radarize.slam.config import SlamConfig
from radarize.tum import planar, planar_poses, read_tum, write_tum


@dataclass(frozen=True)
class Log:
    """Scans, and odometry if there is any.

    Attributes:
        times: of scans, s, in any order.
        azimuths: of the beams, rad, positive to the left.
        ranges: m; inf: nothing seen; nan: not known.
        odometry_times, odometry: s; x, y (m) and yaw (rad).
        covariances: of each motion since the odometry entry before, in the later one's frame; None: not known.
    """

    times: Float[np.ndarray, "scan"]
    azimuths: Float[np.ndarray, "beam"]
    ranges: Float[np.ndarray, "scan beam"]
    odometry_times: Float[np.ndarray, "pose"]
    odometry: Float[np.ndarray, "pose 3"]
    covariances: Float[np.ndarray, "pose 3 3"] | None = None

    @classmethod
    def read(cls, scans: Path, odometry: Path | None = None) -> "Log":
        """Read a log.

        Args:
            scans: a ``.npz`` with ``ranges`` (scan, beam) in m, ``range_max`` in m (that much or more: nothing seen),
                ``angle_min`` and ``angle_increment`` in rad (positive to the left), and ``times`` (scan,) in s; without
                times scan i was taken at second i. Or the folder of a run, whose ``scans.h5`` is taken.
            odometry: TUM file. Of a run's folder its ``odometry.tum`` by default.

        Raises:
            InputError: a file or field is missing or is not as described.
        """
        scans = Path(scans)
        if scans.is_dir():
            times, azimuths, ranges, covariances = _run_scans(scans / "scans.h5")
            odometry = odometry or scans / "odometry.tum"
        else:
            times, azimuths, ranges = _npz_scans(scans)
            covariances = None
        if odometry is None:
            return cls(times, azimuths, ranges, np.zeros(0), np.zeros((0, 3)))
        stamps, poses = read_tum(odometry)
        if covariances is not None and len(covariances) != len(stamps):
            covariances = None  # the odometry is another one
        return cls(times, azimuths, ranges, stamps, planar(poses), covariances)

    def feed(self, slam: Slam, progress: Callable[[int, int], None] | None = None) -> None:
        """Give everything to a session, in order of time, and finish it.

        Args:
            slam: a new session.
            progress: called with (scans done, scans in all).
        """
        spreads = self.covariances if self.covariances is not None else [None] * len(self.odometry_times)
        odometry = deque(zip(self.odometry_times, self.odometry, spreads, strict=True))
        for done, i in enumerate(np.argsort(self.times, kind="stable"), 1):
            while odometry and odometry[0][0] <= self.times[i]:
                slam.add_odometry(*odometry.popleft())
            slam.add_scan(self.times[i], self.azimuths, self.ranges[i])
            if progress:
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
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """SLAM on plain files.

    Args:
        scans, odometry: as in `Log.read`.
        output: folder to write: trajectory.tum (a pose for every scan), odometry.tum, map.pgm and map.yaml, scans.h5
            (with ``trajectory_covariance``), run.json, and reference.tum if there is one: what `radarize evaluate` and
            `radarize report` read.
        config: of the back end.
        reference: TUM file of true poses; of a run's folder its ``reference.tum`` by default.
        progress: called with (scans done, scans in all).

    Returns:
        the folder.

    Raises:
        InputError: unusable input, or the folder cannot be written.
    """
    scans, output = Path(scans), Path(output)
    if scans.is_dir() and output.resolve() == scans.resolve():
        raise InputError(f"{output}: is the run to be read, expected another folder to write")
    log = Log.read(scans, odometry)
    if reference is None and scans.is_dir() and (scans / "reference.tum").is_file():
        reference = scans / "reference.tum"
    truth = None if reference is None else read_tum(reference)
    slam = Slam(config)
    log.feed(slam, progress)
    times, poses = slam.trajectory()
    write_tum(output / "trajectory.tum", times, planar_poses(poses))
    if len(log.odometry):
        write_tum(output / "odometry.tum", log.odometry_times, planar_poses(log.odometry))
    if truth is not None:
        write_tum(output / "reference.tum", *truth)
    slam.map().save(output / "map")
    _write_scans(output / "scans.h5", scans, log, slam)
    facts = {
        "scans": scans.name,
        "odometry": None if odometry is None else Path(odometry).name,
        "slam_settings": config.model_dump(),
        "nodes": len(slam.nodes),
        "submaps": len(slam.submaps),
        "skipped": slam.skipped,
        "closures": int(slam.graph.accepted.sum()),
        "closures_rejected": int((~slam.graph.accepted).sum()),
        "radarize_version": __version__,
    }
    (output / "run.json").write_text(json.dumps(facts, indent=2))
    return output


def _npz_scans(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    try:
        with np.load(path, allow_pickle=False) as file:
            if not hasattr(file, "files"):
                raise ValueError("a single array")
            found = {name: np.asarray(file[name], float) for name in file.files}
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except (ValueError, zipfile.BadZipFile, EOFError) as error:
        raise InputError(f"{path}: is no .npz of numbers ({error}), expected ranges, angle_min...") from error
    for name in ("ranges", "angle_min", "angle_increment", "range_max"):
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
    azimuths = found["angle_min"].item() + found["angle_increment"].item() * np.arange(ranges.shape[1])
    return times, azimuths, np.where(ranges >= found["range_max"].item(), np.inf, ranges)


def _run_scans(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray | None]:
    try:
        with h5py.File(path, "r") as file:
            for name in ("time", "ranges", "azimuths"):
                if name not in file:
                    raise InputError(f"{path}: has no /{name}, expected /time, /ranges and /azimuths")
            spread = file["step_covariance"][()] if "step_covariance" in file else None
            times, azimuths, ranges = (file[name][()].astype(float) for name in ("time", "azimuths", "ranges"))
    except OSError as error:
        raise InputError(f"{path}: is no readable HDF5 file ({str(error).splitlines()[0]})") from error
    if ranges.shape != (len(times), len(azimuths)):
        raise InputError(f"{path}: /ranges has shape {ranges.shape}, expected {(len(times), len(azimuths))}")
    return times, azimuths, ranges, spread


def _write_scans(path: Path, source: Path, log: Log, slam: Slam) -> None:
    with replacing(path) as part:
        if source.is_dir():
            shutil.copyfile(source / "scans.h5", part)
        _add_scans(part, log, slam)


def _add_scans(path: Path, log: Log, slam: Slam) -> None:
    with h5py.File(path, "a") as file:
        values = {"time": log.times, "azimuths": log.azimuths, "ranges": log.ranges}
        for name, data in {**values, "trajectory_covariance": slam.covariances()}.items():
            if name in file:
                del file[name]
            file.create_dataset(name, data=data)
