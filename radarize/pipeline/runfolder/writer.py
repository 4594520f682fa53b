"""Writer of a run folder: each result is written as soon as it is computed, and the folder appears only when it is
complete."""

import errno
import json
import platform as machine
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import torch
from jaxtyping import Int, Shaped

from radarize import __version__
from radarize.io.errors import FULL, InputError, explained
from radarize.io.recording import Clip, Recording
from radarize.io.replacing import Replacement
from radarize.io.tum import planar_poses, write_poses
from radarize.pipeline.health import Health
from radarize.pipeline.pipeline import Result
from radarize.pipeline.runfolder.occupancy import OccupancyMap
from radarize.pipeline.runfolder.reader import FILES, Poses, Scans
from radarize.radar.config import RadarConfig
from radarize.signal import polar
from radarize.signal.bearings import BEARINGS
from radarize.signal.heatmaps import Heatmaps
from radarize.slam.backend import Slam

#: Truth of a recording that is copied into a run.
_TRUTH = ("velocity", "scan", "scan_azimuths", "floor_plan", "pose", "time")
#: Number of heat maps stored for the report, spread over the recording.
_PICTURES = 6
#: Bytes of a chunk of ``scans.h5``, frames of truth copied at a time, and bytes of disk that stay free because HDF5
#: does not report all write errors.
_CHUNK, _FRAMES, _RESERVE = 16 << 10, 1024, 1 << 20


class RunWriter:
    """Context manager that writes the results of a pipeline to a run folder. Without `finish` nothing is left behind,
    and an existing run stays as it was.

        with RunWriter(folder, radar) as writer:
            for result in pipeline.run(batches):
                writer.add(result)
            writer.describe(recording[:], heatmaps)
            writer.finish(pipeline.slam, facts)

    Args:
        radar: configuration; None for a session without radar frames.

    Attributes:
        health: conditions that degraded odometry so far.

    Raises:
        InputError: the folder cannot be written.
    """

    def __init__(self, folder: str | Path, radar: RadarConfig | None = None):
        self.folder, self.health = Path(folder), None if radar is None else Health(radar)
        self._facts: dict[str, Any] = {}
        self._files = Replacement(self.folder, FILES)
        try:
            with self._writing():
                self._scans = h5py.File(self._files.part / "scans.h5", "w", rdcc_nbytes=4 * _CHUNK)
        except InputError:
            self._files.discard()
            raise

    def __enter__(self) -> "RunWriter":
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._scans.close()
        except (OSError, RuntimeError):
            pass  # of a run that goes anyway
        finally:
            self._files.discard()

    def add(self, result: Result) -> None:
        """Write the result of a batch."""
        track = result.track
        if not len(track.time):
            return
        assert self.health is not None
        self.health.add(result)
        self.extend("time", track.time, "s, burst middles")
        self.extend("frames", result.frames, "numbers, gaps counted")
        self.extend("ranges", result.ranges, "m, inf: nothing seen")
        self.extend("velocity", track.velocity, "m/s, sensor frame")
        self.extend("velocity_covariance", track.velocity_covariance, "m^2/s^2")
        self.extend("velocity_seen", track.velocity_seen, "False: nothing determined the velocity")
        self.extend("turn_seen", track.turn_seen, "False: nothing determined the turn since the frame before")
        self.extend("errors/duration", track.errors.duration, "s, of the step since the frame before")
        self.extend(
            "errors/noise", track.errors.noise, "m^2, m rad, rad^2: what the step adds to the error of odometry"
        )
        self.extend(
            "errors/correlation", track.errors.correlation, "share that goes on: of heading's error, velocity's"
        )
        self.extend("errors/variance", track.errors.variance, "rad^2, m^2/s^2: of the errors of heading and velocity")
        self.write_poses("odometry", (track.time, planar_poses(track.pose)))

    def describe(self, frames: Clip, heatmaps: Heatmaps, warnings: Sequence[str] = ()) -> None:
        """Set the frames that the run is made from, with their truth and warnings, and store heat maps of some for
        reports.

        Args:
            warnings: warnings of the recording, which come first.

        Raises:
            InputError: the recording is damaged.
        """
        recording, span = frames.recording, frames.span
        times, period, name = self._scans["time"], recording.config.frame_period, recording.path.name
        attributes = {k: v for k, v in recording.attributes.items() if isinstance(v, str | int | float)}
        centers = recording.times[[span.start, span.stop - 1]] + recording.config.burst_center
        assert self.health is not None
        observability = self.health.observability
        observability.lost(float(centers[0]), float(times[0]))
        observability.lost(float(times[-1]), float(centers[1]))
        self._facts |= {
            "recording": name,
            "recording_attributes": attributes,
            "frames": len(span),
            "duration_s": float(times[-1] - times[0] + period),
            "blind": observability.found.model_dump(),
            "health": [each.model_dump() for each in self.health.found],
            "warnings": [*recording.damage, *warnings, *self.health.warnings()],
            "radar": recording.config.model_dump(mode="json"),
        }
        rows = np.searchsorted(recording.times + recording.config.burst_center, times[:])
        self.put("azimuths", BEARINGS, "rad")
        self._copy_truth(recording, rows)
        self._picture(recording, rows, heatmaps)

    def _copy_truth(self, recording: Recording, used: Int[np.ndarray, "scan"]) -> None:
        def unit(name: str) -> str:
            return str(recording.describe(f"truth/{name}")["unit"])

        if poses := recording.true_poses():
            self.write_poses("reference", poses)
        for name in (name for name in _TRUTH if recording.has(f"truth/{name}")):
            if name not in ("velocity", "scan"):
                self.put(f"truth/{name}", recording.read(f"truth/{name}"), unit(name))
                continue
            for start in range(0, len(used), _FRAMES):  # a row for every frame
                frames = used[start : start + _FRAMES]
                rows = recording.rows(f"truth/{name}", int(frames[0]), int(frames[-1]) + 1)
                if len(rows) <= frames[-1] - frames[0]:
                    raise InputError(f"{recording.path}: /truth/{name} ends before its frames, expected a row for each")
                self.extend(f"truth/{name}", rows[frames - frames[0]], unit(name))

    def _picture(self, recording: Recording, used: Int[np.ndarray, "scan"], maps: Heatmaps) -> None:
        shown = np.unique(np.linspace(0, len(used) - 1, _PICTURES).astype(int))
        frames = used[shown]
        self.put("heatmaps/frames", shown, "index into /time")
        if not recording.has_samples:
            pictures = np.concatenate([recording.rows(polar.PICTURE, k, k + 1) for k in frames])
            self.put("heatmaps/range_azimuth", polar.power(pictures), "share of the strongest cell")
            self.put("heatmaps/ranges", polar.RANGES, "m")
            self.put("heatmaps/azimuths", polar.AZIMUTHS, "rad")
            return
        spectrum = torch.cat([maps.spectrum(recording.adc(k, k + 1), recording.valid(k, k + 1)) for k in frames])
        self.put("heatmaps/range_azimuth", maps.range_azimuth_of(spectrum).numpy(), "counts^2")
        self.put("heatmaps/doppler_azimuth", maps.doppler_azimuth_of(spectrum).numpy(), "counts^2")
        if maps.pairs is not None:
            self.put("heatmaps/elevation_aware", maps.elevation_aware_of(spectrum).numpy(), "counts^2")
        self.put("heatmaps/ranges", maps.ranges, "m")
        self.put("heatmaps/azimuths", maps.azimuths, "rad")
        self.put("heatmaps/velocities", maps.velocities, "m/s, closing positive")

    def finish(self, slam: Slam, facts: Mapping[str, object]) -> Path:
        """Write trajectory with its covariances, map and ``run.json`` of a finished session, and move the folder into
        place.

        Raises:
            InputError: a file cannot be written.
        """
        times, poses = slam.trajectory()
        self.write_poses("trajectory", (times, planar_poses(poses)))
        self.put("trajectory_covariance", slam.covariances(), "m^2, m rad, rad^2")
        made = {
            "warnings": [*self._facts.get("warnings", ()), *slam.warnings()],
            "nodes": len(slam.nodes),
            "submaps": len(slam.submaps),
            "skipped": slam.skipped,
            "closures": int(slam.graph.accepted.sum()),
            "closures_rejected": int((~slam.graph.accepted).sum()),
            "radarize_version": __version__,
            "python": machine.python_version(),
            "machine": f"{machine.system()} {machine.machine()}",
        }
        OccupancyMap.of(slam.map()).save(self._files.part / "map.yaml")
        with self._writing():
            (self._files.part / "run.json").write_text(json.dumps({**self._facts, **facts, **made}, indent=2))
            self._scans.close()
        self._files.place()
        return self.folder

    # --- pieces ------------------------------------------------------------------------------------------------------
    def put(self, name: str, data: Shaped[np.ndarray, "..."], unit: str) -> None:
        """Write a complete data set of ``scans.h5``."""
        with self._writing(data.nbytes):
            self._scans.create_dataset(name, data=data).attrs["unit"] = unit

    def extend(self, name: str, rows: Shaped[np.ndarray, "row ..."], unit: str) -> None:
        """Append rows to a data set of ``scans.h5``."""
        with self._writing(rows.nbytes):
            if name not in self._scans:
                shape, size = rows.shape[1:], max(rows.nbytes // max(len(rows), 1), 1)
                chunk = (max(_CHUNK // size, 1), *shape)
                data = self._scans.create_dataset(name, (0, *shape), rows.dtype, maxshape=(None, *shape), chunks=chunk)
                data.attrs["unit"] = unit
            data = self._scans[name]
            data.resize(len(data) + len(rows), axis=0)
            data[-len(rows) :] = rows

    def inherit(self, scans: Scans, without: tuple[str, ...]) -> None:
        """Copy another run's data sets of ``scans.h5``, except for some."""
        assert scans.path is not None
        with self._writing(scans.path.stat().st_size):
            scans.copy(self._scans, without)

    def write_poses(self, name: str, poses: Poses) -> None:
        """Append poses to ``NAME.tum``."""
        with self._writing(), (self._files.part / f"{name}.tum").open("a") as file:
            write_poses(file, *poses)

    @contextmanager
    def _writing(self, size: int = 0) -> Iterator[None]:
        """Turn write errors into InputErrors; refuse if the disk has less than `size` bytes free."""
        with explained(f"{self.folder}: cannot be written", OSError, RuntimeError):
            if shutil.disk_usage(self._files.part).free < size + _RESERVE:
                raise OSError(errno.ENOSPC, FULL)
            yield
