"""From raw I/Q to trajectory and map: the whole of Radarize, frame batch by frame batch."""

import json
import platform as machine
import time as clock
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np
import torch

from radarize import __version__
from radarize.errors import InputError
from radarize.mapping.scans import BEARINGS, ScanConfig
from radarize.methods import BEST, CLASSICAL, ODOMETRY, SCANS, Inputs, Weights, best_methods
from radarize.odometry.integration import Track
from radarize.published.chain import CHAINS, Chain
from radarize.published.heatmaps import PublishedMaps
from radarize.radar.config import RadarConfig
from radarize.recording import Recording
from radarize.settings import SETTINGS
from radarize.slam.backend import Slam
from radarize.slam.config import SlamConfig
from radarize.tum import planar, planar_poses, write_tum

#: A frame with a smaller share of its chirps is left out. On a simulated walk, with the rest of each burst lost, 95 %
#: of Doppler velocities are within 0.02 m/s from whole bursts, 0.06 m/s from an eighth, 0.21 m/s from a sixteenth.
LEAST_SHARE = 1 / 8
#: Frames a batch: enough to vectorise over, few enough to stay in cache.
BATCH = 16
#: Heat maps kept for the report, spread over the recording.
_PICTURES = 6


class Pipeline:
    """Radar SLAM as a stream: push raw frames, then read trajectory and map. Memory grows with the path, not the data.

    Lost chirps weigh nothing. Frames that are lost as a whole, or nearly, or silent, leave a gap, over which odometry
    takes motion to change evenly; `frames` says which ones are left.

    Args:
        config: radar configuration.
        scans: how scans are made, a key of `radarize.methods.SCANS`.
        odometry: where motion comes from, a key of `radarize.methods.ODOMETRY`.
        weights: of the networks; the shipped ones if None.
        recording: with other sensors' streams, for methods that use them.
        chain: what else makes odometry and scans of samples, then in place of all these.

    Raises:
        InputError: an unknown method, or networks that do not fit the radar.
    """

    def __init__(
        self,
        config: RadarConfig,
        scans: str = CLASSICAL["scans"],
        odometry: str = CLASSICAL["odometry"],
        weights: Weights | None = None,
        recording: Recording | None = None,
        chain: Chain | None = None,
    ):
        self.config, self.scans, self.chain = config, scans, chain
        self._inputs = Inputs(config, weights, scans, recording, self._stage)
        self.heatmaps = self._inputs.heatmaps
        self.odometry, self.scanner = self._inputs.odometry(odometry), self._inputs.scanner()
        self.slam = Slam(SlamConfig.preset("radar"))
        self.pushed = self.lost = 0
        self.frames: list[np.ndarray] = []  # numbers of those used, counted as pushed
        self.times: list[np.ndarray] = []
        self.poses: list[np.ndarray] = []
        self.velocities: list[np.ndarray] = []
        self.velocity_covariances: list[np.ndarray] = []
        self.step_covariances: list[np.ndarray] = []
        self.ranges: list[np.ndarray] = []
        self.stage_seconds: dict[str, float] = defaultdict(float)

    def push(self, adc: np.ndarray, times: np.ndarray, valid: np.ndarray | None = None) -> None:
        """Process the next frames.

        Args:
            adc: int16 (frame, loop, tx, rx, sample, iq).
            times: (frame,) stamps, s.
            valid: (frame, loop, tx), False where a chirp was lost.
        """
        numbers = self.pushed + np.arange(len(times))
        self.pushed += len(times)
        if self.chain:
            used = numbers % self.chain.stride == 0
            track, ranges = self.chain.push(adc, times, self._stage)
        else:
            used = adc.reshape(len(adc), -1).any(axis=1)  # networks would see motion in nothing, too
            if valid is not None:
                used &= valid.mean(axis=(1, 2)) >= LEAST_SHARE
                valid = valid[used]
            self.lost += int(np.count_nonzero(~used))
            adc, times = adc[used], times[used]
            if not len(times):
                return
            track, ranges = self._follow(adc, times, valid)
        self.frames.append(numbers[used])
        with self._stage("slam"):
            for instant, pose, spread, scan in zip(track.time, track.pose, track.covariance, ranges, strict=True):
                self.slam.add_odometry(instant, pose, spread)
                self.slam.add_scan(instant, BEARINGS, scan)
        self.times.append(track.time)
        self.poses.append(track.pose)
        self.velocities.append(track.velocity)
        self.velocity_covariances.append(track.velocity_covariance)
        self.step_covariances.append(track.covariance)
        self.ranges.append(ranges.astype(np.float32))

    def _follow(self, adc: np.ndarray, times: np.ndarray, valid: np.ndarray | None) -> tuple[Track, np.ndarray]:
        with self._stage("spectra"):
            spectrum = self.heatmaps.spectrum(adc, valid)
        return self.odometry.follow(spectrum, times, self._stage), self.scanner.scan(spectrum)

    def finish(self) -> None:
        """Close the last loops and optimise."""
        with self._stage("slam"):
            self.slam.finish()

    @contextmanager
    def _stage(self, name: str) -> Iterator[None]:
        """Time a step; what steps within it take is theirs."""
        start, others = clock.perf_counter(), sum(self.stage_seconds.values())
        yield
        within = sum(self.stage_seconds.values()) - others
        self.stage_seconds[name] += clock.perf_counter() - start - within


def run(
    recording: Path,
    output: Path,
    *,
    odometry: str | None = None,
    scans: str | None = None,
    settings: str = "corrected",
    weights: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Run the pipeline on a recording.

    Args:
        recording: ``.h5`` file, simulated or real.
        output: folder to write: trajectory.tum (SLAM), odometry.tum, reference.tum (if the recording has true poses),
            map.pgm and map.yaml, scans.h5, run.json.
        odometry, scans: methods by name; if None, networks where they fit the radar, else the classical ones.
        settings: reading of the paper, a key of `SETTINGS`. ``published`` is a chain of its own, which needs weights
            and, like the artefact, starts from true headings where the recording has them.
        weights: folder of the networks' weights; the shipped ones if None.
        progress: called with (frames done, frames in all).

    Returns:
        the folder.

    Raises:
        InputError: unusable recording or unknown method.
    """
    chosen = (("odometry", odometry, ODOMETRY), ("scans", scans, SCANS), ("settings", settings, SETTINGS))
    for name, value, known in chosen:
        if value is not None and value not in known:
            raise InputError(f"{name} is {value!r}, expected one of {', '.join(known)}")
    output = Path(output)
    with Recording(recording) as source:
        if not len(source):
            raise InputError(f"{recording}: has no whole frame, expected at least one")
        if settings == "published":
            chain, why = _published(source, weights, odometry, scans), ""
            pipeline, odometry, scans = Pipeline(source.config, chain=chain), settings, settings
        else:
            methods, why = (BEST, "") if weights else best_methods(source.config)
            odometry, scans = odometry or methods["odometry"], scans or methods["scans"]
            pipeline = Pipeline(source.config, scans, odometry, Weights(weights), source)
        for frames, adc in source.batches(BATCH):
            pipeline.push(adc, source.times[frames], source.valid(frames.start, frames.stop))
            if progress:
                progress(frames.stop, len(source))
        if not pipeline.times:
            raise InputError(f"{recording}: all its {len(source)} frames are lost or silent, expected one with samples")
        pipeline.finish()
        output.mkdir(parents=True, exist_ok=True)
        methods = {"odometry": odometry, "scans": scans, "settings": settings} | ({"no networks": why} if why else {})
        _write(pipeline, source, output, methods)
    return output


def _published(source: Recording, weights: Path | None, odometry: str | None, scans: str | None) -> Chain:
    """The artefact's chain for a recording."""
    for name, value in (("odometry", odometry), ("scans", scans)):
        if value is not None:
            raise InputError(f"{name} is {value!r}, expected none with settings published, which has its own")
    if weights is None:
        raise InputError(
            "settings is 'published', which comes without weights: train them (`radarize train --settings published`) "
            "and name their folder with --weights"
        )
    headings, stride = None, PublishedMaps.stride(source.config)
    if source.has("truth/pose"):
        yaws = planar(source.rows("truth/pose", 0, CHAINS * stride)[::stride])[:, 2]
        headings = yaws if len(yaws) == CHAINS and np.isfinite(yaws).all() else None
    return Chain(source.config, weights, headings)


def _write(pipeline: Pipeline, source: Recording, output: Path, methods: dict[str, str]) -> None:
    times, poses = np.concatenate(pipeline.times), np.concatenate(pipeline.poses)
    write_tum(output / "odometry.tum", times, planar_poses(poses))
    slam_times, slam_poses = pipeline.slam.trajectory()
    write_tum(output / "trajectory.tum", slam_times, planar_poses(slam_poses))
    if source.has("truth/pose") and source.has("truth/time"):
        true_times, true_poses = source.read("truth/time"), source.read("truth/pose")
        known = np.isfinite(true_poses).all(axis=1)  # a tracking camera may have been blind for a while
        write_tum(output / "reference.tum", true_times[known], true_poses[known])
    pipeline.slam.map().save(output / "map")
    _write_scans(pipeline, source, output / "scans.h5", times)
    frames = len(source)
    facts = {
        "recording": source.path.name,
        "recording_attributes": {k: v for k, v in source.attributes.items() if isinstance(v, (str, int, float))},
        "frames": frames,
        "frames_lost": pipeline.lost,
        "duration_s": float(times[-1] - times[0] + source.config.frame_period),
        "methods": methods,
        "radar": source.config_json(),
        "scan_settings": ScanConfig().model_dump(),
        "slam_settings": pipeline.slam.config.model_dump(),
        "ms_per_frame": {name: 1e3 * seconds / frames for name, seconds in pipeline.stage_seconds.items()},
        "closures": int(pipeline.slam.graph.accepted.sum()),
        "closures_rejected": int((~pipeline.slam.graph.accepted).sum()),
        "nodes": len(pipeline.slam.nodes),
        "radarize_version": __version__,
        "python": machine.python_version(),
        "machine": f"{machine.system()} {machine.machine()}",
    }
    (output / "run.json").write_text(json.dumps(facts, indent=2))


def _write_scans(pipeline: Pipeline, source: Recording, path: Path, times: np.ndarray) -> None:
    used = np.concatenate(pipeline.frames)
    with h5py.File(path, "w") as file:

        def put(name: str, data: np.ndarray, unit: str) -> None:
            file.create_dataset(name, data=data).attrs["unit"] = unit

        put("time", times, "s, burst middles")
        put("ranges", np.concatenate(pipeline.ranges), "m, inf: nothing seen")
        put("azimuths", BEARINGS, "rad")
        put("velocity", np.concatenate(pipeline.velocities), "m/s, sensor frame")
        put("velocity_covariance", np.concatenate(pipeline.velocity_covariances), "m^2/s^2")
        put("step_covariance", np.concatenate(pipeline.step_covariances), "m^2, m rad, rad^2: of odometry since before")
        for name in ("velocity", "scan", "scan_azimuths", "floor_plan", "pose", "time"):
            if source.has(f"truth/{name}"):
                truth = source.read(f"truth/{name}")
                truth = truth[used] if name in ("velocity", "scan") else truth  # a row for every frame
                put(f"truth/{name}", truth, str(source.describe(f"truth/{name}")["unit"]))
        shown = np.unique(np.linspace(0, len(used) - 1, _PICTURES).astype(int))
        maps = pipeline.heatmaps
        spectrum = torch.cat([maps.spectrum(source.adc(k, k + 1), source.valid(k, k + 1)) for k in used[shown]])
        put("heatmaps/frames", shown, "index into /time")
        put("heatmaps/range_azimuth", maps.range_azimuth_of(spectrum).numpy(), "counts^2")
        put("heatmaps/doppler_azimuth", maps.doppler_azimuth_of(spectrum).numpy(), "counts^2")
        if maps.pairs is not None:
            put("heatmaps/elevation_aware", maps.elevation_aware_of(spectrum).numpy(), "counts^2")
        put("heatmaps/ranges", maps.ranges, "m")
        put("heatmaps/azimuths", maps.azimuths, "rad")
        put("heatmaps/velocities", maps.velocities, "m/s, closing positive")
