"""Comparison of a recording with its twin, frame by frame: the same radar on the same walk, in the real place and in
its model (`radarsim twin`).

Maps are those that networks get (`radarize.signal.maps`), in dB relative to their median, so that the receiver's gain,
which is compared separately, and the noise of empty cells have no influence. Velocities and scans are estimated without
networks from single frames (Doppler least squares; Capon's maps, first echo), so that any radar has them.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float, Int

from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.odometry.doppler import DopplerVelocity
from radarize.radar.config import RadarConfig
from radarize.radar.noise import noise_floor, noise_profile
from radarize.scans.extraction import Maps, ScanConfig
from radarize.signal.batch import Batch, Signal
from radarize.signal.maps import MAPS
from radarsim.twin.likeness import correlation, foreground, frechet_distance, patch_statistics, similarity

#: Quantities compared for every frame, with unit and description. Those of maps end in the map's name.
FIGURES = {
    "profile_correlation": ("", "correlation of the range profiles in dB"),
    "profile_rms": ("dB", "RMS difference of the range profiles, gain taken out"),
    "gain": ("dB", "twin over recording: median over the range profile, where it is well above its floor"),
    "noise": ("dB", "noise floor, twin over recording"),
    **{f"correlation_{name}": ("", f"correlation: {about}") for name, about in MAPS.items()},
    **{f"similarity_{name}": ("", f"MS-SSIM: {about}") for name, about in MAPS.items()},
    "velocity": ("m/s", "length of the difference of the velocities"),
    "velocity_error_recording": ("m/s", "recording's velocity against that of the poses"),
    "velocity_error_twin": ("m/s", "twin's velocity against that of the poses"),
    "bearings_within_10cm": ("", "share of bearings returned by both whose ranges agree within 10 cm"),
    "bearings_returned": ("", "share of the recording's returned bearings that the twin returns too"),
}
#: Shifts of the twin that are tried in both directions: s, rad, m.
SHIFTS = {"time": 1.5, "azimuth": np.radians(18.0), "range": 0.5}
#: Number of frames for which shifts are tried, spread over the recording.
_TRIED = 200
#: Smallest gain in correlation, correlation and number of frames at which a shift is reported.
BETTER, WELL, FEWEST = 0.05, 0.3, 5
#: Largest difference between time stamps of the same frame, s.
_SAME = 1e-4
#: Smallest number of loops for an estimate of noise and velocity.
_LOOPS = 8
_BATCH = 16


@dataclass
class Comparison:
    """Figures of the comparison and the data behind them, frame by frame.

    Attributes:
        config: radar configuration.
        frames: frame indices in the recording and in the twin.
        times: times since the recording's first frame, s.
        ranges, azimuths: of the range-azimuth maps' cells, m and rad.
        profiles: of recording and twin, counts^2.
        noise: noise floors of recording and twin, counts^2.
        figures: one value a frame, NaN where there is none, see `FIGURES`.
        chance: medians of the same figures between unrelated frames: the recording's, and the twin's of half a
            recording later.
        velocity: of recording, twin, and poses (NaN if unknown), m/s, forward and left; none of a single antenna.
        scans: of recording and twin on `BEARINGS`, m, inf without a return; empty for a single antenna.
        alignment: mean correlation of range-azimuth maps over shifts of the twin: for each kind of shift, the shifts
            (s, rad, m) and the correlations.
        frechet: by map, Fréchet distance of patch statistics: between recording and twin, and, for scale, between the
            recording's two halves, dB.
    """

    config: RadarConfig
    frames: Int[np.ndarray, "frame 2"]
    times: Float[np.ndarray, "frame"]
    ranges: Float[np.ndarray, "range"]
    azimuths: Float[np.ndarray, "azimuth"]
    profiles: Float[np.ndarray, "frame 2 range"]
    noise: Float[np.ndarray, "frame 2"]
    figures: dict[str, np.ndarray] = field(default_factory=dict)
    chance: dict[str, float] = field(default_factory=dict)
    velocity: Float[np.ndarray, "frame 3 2"] = field(default_factory=lambda: np.empty((0, 3, 2)))
    scans: Float[np.ndarray, "frame 2 bearing"] = field(default_factory=lambda: np.empty((0, 2, 0)))
    alignment: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    frechet: dict[str, tuple[float, float]] = field(default_factory=dict)

    def misfits(self) -> dict[str, tuple[float, float]]:
        """Shifts that improve the agreement of the maps: the shift (s, rad, m) and the gain in correlation.

        They indicate errors in time, heading or distances of the poses, or in the scene. A best shift at the end of the
        range that was tried, or one of few frames, is not conclusive.
        """
        found: dict[str, tuple[float, float]] = {}
        if len(self.frames) < FEWEST:
            return found
        for name, (shifts, values) in self.alignment.items():
            best, here = int(np.argmax(values)), values[np.argmin(np.abs(shifts))]
            if values[best] > max(here + BETTER, WELL) and 0 < best < len(values) - 1:
                found[name] = (float(shifts[best]), float(values[best] - here))
        return found

    @property
    def noise_counts(self) -> Float[np.ndarray, "2"]:
        """Noise of recording and twin, counts; NaN if unknown."""
        known = self.noise[np.isfinite(self.noise).all(axis=1)]
        return np.sqrt(np.median(known, axis=0)) if len(known) else np.full(2, np.nan)

    def summary(self) -> dict[str, Any]:
        """All figures as plain data; NaN becomes None."""
        spread = pd.DataFrame(self.figures).dropna(axis=1, how="all").quantile([0.5, 0.1, 0.9])
        spread = spread.set_axis(["median", "p10", "p90"])
        spread.loc["unrelated_frames"] = pd.Series(self.chance)
        return _plain({
            "frames": len(self.frames),
            "figures": spread.to_dict(),
            "noise_counts": dict(zip(("recording", "twin"), self.noise_counts, strict=True)),
            "frechet_db": {n: {"twin": a, "own_halves": b} for n, (a, b) in self.frechet.items()},
            "misfits": {n: {"shift": a, "gain": b} for n, (a, b) in self.misfits().items()},
            "alignment": {n: {"shift": a, "correlation": b} for n, (a, b) in self.alignment.items()},
            "per_frame": {"frame": self.frames[:, 0], "time": self.times, **self.figures},
        })  # fmt: skip


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _plain(item) for name, item in value.items()}
    if np.ndim(value):
        return [_plain(item) for item in value]
    if isinstance(value, int | np.integer):
        return int(value)
    return round(float(value), 5) if np.isfinite(value) else None


def compare(real: Path, twin: Path, progress: Callable[[int, int], None] | None = None) -> Comparison:
    """Compare a recording with its twin. Needs some 100 kB of memory per frame.

    Args:
        real, twin: recordings of the same radar configuration; frames of equal time stamp are compared.
        progress: called with (frames done, total frames).

    Raises:
        InputError: unusable recordings, other configurations, or no frame in common.
    """
    with Recording(real) as one, Recording(twin) as other:
        _require_same(one, other)
        frames = _pairs(one, other)
        analysis = _Analysis(one.config)
        parts = []
        for first in range(0, len(frames), _BATCH):
            batch = frames[first : first + _BATCH]
            parts.append([analysis(source, batch[:, k]) for k, source in enumerate((one, other))])
            if progress:
                progress(min(first + _BATCH, len(frames)), len(frames))
        moved = other.read("truth/velocity")[frames[:, 1], :2] if other.has("truth/velocity") else np.nan
    seen = [{name: np.concatenate([part[k][name] for part in parts]) for name in parts[0][k]} for k in range(2)]
    start = one.times[0]
    profiles, noise = (np.stack([part[name] for part in seen], axis=1) for name in ("profile", "noise"))
    times = one.times[frames[:, 0]] - start
    result = Comparison(one.config, frames, times, analysis.ranges, analysis.azimuths, profiles, noise)
    result.figures = _figures(*seen)
    half = len(frames) // 2
    if half:
        later = {name: np.roll(values, -half, axis=0) for name, values in seen[1].items()}
        result.chance = {n: float(np.nanmedian(v)) for n, v in _figures(seen[0], later).items() if np.isfinite(v).any()}
    if "range_azimuth" in seen[0]:
        result.velocity = np.stack([*(part["velocity"] for part in seen), np.broadcast_to(moved, (len(frames), 2))], 1)
        for k, name in enumerate(("recording", "twin")):
            off = np.linalg.norm(result.velocity[:, k] - result.velocity[:, 2], axis=1)
            result.figures[f"velocity_error_{name}"] = off
        result.scans = np.stack([part["scan"] for part in seen], axis=1)
        result.alignment = _alignment(seen[0]["range_azimuth"], seen[1]["range_azimuth"], result)
        result.frechet = {name: _distances(seen[0][name], seen[1][name]) for name in analysis.maps}
    return result


def _require_same(one: Recording, other: Recording) -> None:
    for name, value in one.config:
        if getattr(other.config, name) != value:
            raise InputError(
                f"{other.path}: {name} is {getattr(other.config, name)}, expected {value} as in {one.path}"
            )


def _pairs(one: Recording, other: Recording) -> Int[np.ndarray, "frame 2"]:
    """Indices of frames with equal time stamps, without those that are completely lost in either recording."""
    if not len(one) or not len(other):
        raise InputError(f"{(other if len(one) else one).path}: has no whole frame, expected at least one")
    nearest = np.clip(np.searchsorted(other.times, one.times - _SAME), 0, len(other) - 1)
    same = np.abs(other.times[nearest] - one.times) <= _SAME
    there = np.any(one.valid(0, len(one)), axis=(1, 2)) & np.any(other.valid(0, len(other)), axis=(1, 2))[nearest]
    if not same.any():
        raise InputError(f"{other.path}: has no frame with the stamp of a frame of {one.path}, expected its twin")
    if not (same & there).any():
        raise InputError(f"{other.path}: all frames that it shares with {one.path} are lost, expected one with samples")
    return np.column_stack([np.arange(len(one)), nearest])[same & there]


class _Analysis:
    """Compared quantities of frames: range profile, noise, and, with several antennas, maps, velocity and scan."""

    def __init__(self, config: RadarConfig):
        self.config, self._signal = config, Signal(config)
        self.maker = self._signal.maker
        self.ranges, self.azimuths = self.maker.heatmaps.ranges, self.maker.heatmaps.azimuths
        self.maps = self.maker.names if len(self.maker.heatmaps.row) > 1 else ()
        self._far = self.ranges >= ScanConfig().min_range  # nearer cells contain leakage, the same everywhere
        self._velocity = DopplerVelocity(self.maker.heatmaps)

    def __call__(self, source: Recording, frames: Int[np.ndarray, "frame"]) -> dict[str, np.ndarray]:
        adc = np.concatenate([source.adc(k, k + 1) for k in frames])
        valid = np.concatenate([source.valid(k, k + 1) for k in frames])
        batch = Batch(self._signal, adc, source.times[frames], valid)
        spectrum = batch.spectrum
        power = spectrum.abs().square().sum(dim=2).mean(dim=-1).numpy()
        found = {"profile": power, "noise": self._noise(adc, valid), "far": np.broadcast_to(self._far, power.shape)}
        if not self.maps:
            return found
        for name, made in batch.maps(self.maps).items():
            rows = self._far if not name.startswith("doppler") else slice(None)
            found[name] = foreground(made.astype(np.float32)[:, rows]).astype(np.float16)
        found["velocity"] = self._velocities(batch)
        sharp = self.maker.heatmaps.range_azimuth_of(spectrum, "capon").numpy()
        found["scan"] = Maps.of(self.maker.heatmaps, ScanConfig(), [sharp]).scans("first-echo")
        return found

    def _noise(self, adc: np.ndarray, valid: np.ndarray) -> Float[np.ndarray, "frame"]:
        """Noise floors, counts^2; NaN for frames with lost chirps, or with too few loops for an estimate."""
        signal = adc.astype(np.float32).view(np.complex64)[..., 0]
        whole = np.all(valid, axis=(1, 2)) & (self.config.loops >= _LOOPS)
        return np.array(
            [noise_floor(noise_profile(s[None])) if w else np.nan for s, w in zip(signal, whole, strict=True)]
        )

    def _velocities(self, batch: Batch) -> Float[np.ndarray, "frame 2"]:
        if self.config.loops < _LOOPS:
            return np.full((len(batch), 2), np.nan)
        found = self._velocity.estimate(batch)
        return np.where(found.inliers[:, None] > 0, found.velocity, np.nan)


def _figures(real: dict[str, np.ndarray], twin: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Figures by name, one value per pair of frames."""
    far = real["far"][0]
    level = [10 * np.log10(np.maximum(part["profile"][:, far], 1e-9)) for part in (real, twin)]
    apart = level[1] - level[0]
    # Echoes: cells 10 dB above the level of most bins.
    heard = level[0] > np.quantile(level[0], 0.25, axis=1, keepdims=True) + 10
    gain = np.array([np.median(row[h]) if h.any() else np.median(row) for row, h in zip(apart, heard, strict=True)])
    found = {
        "profile_correlation": correlation(level[0], level[1]),
        "profile_rms": np.sqrt(np.mean((apart - gain[:, None]) ** 2, axis=1)),
        "gain": gain,
        "noise": 10 * np.log10(twin["noise"] / real["noise"]),
    }
    for name in (n for n in real if n in MAPS):
        found[f"correlation_{name}"] = correlation(real[name], twin[name])
        found[f"similarity_{name}"] = similarity(real[name], twin[name])
    if "scan" in real:
        found["velocity"] = np.linalg.norm(twin["velocity"] - real["velocity"], axis=1)
        one, other = np.isfinite(real["scan"]), np.isfinite(twin["scan"])
        with np.errstate(invalid="ignore", divide="ignore"):
            near = np.abs(np.where(one & other, twin["scan"], 0) - np.where(one & other, real["scan"], 0)) <= 0.10
            found["bearings_within_10cm"] = (near & one & other).sum(axis=1) / (one & other).sum(axis=1)
            found["bearings_returned"] = (one & other).sum(axis=1) / one.sum(axis=1)
    return found


def _alignment(real: np.ndarray, twin: np.ndarray, result: Comparison) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Mean correlations over shifts of the twin's range-azimuth maps."""
    tried = np.unique(np.linspace(0, len(real) - 1, _TRIED).astype(int))
    some = real[tried], twin[tried]
    period = float(np.median(np.diff(result.times))) if len(result.times) > 1 else np.inf
    found = {}
    for name, axis, step, maps in (
        ("time", 0, period, (real, twin)),
        ("azimuth", 2, float(result.azimuths[1] - result.azimuths[0]), some),
        ("range", 1, float(result.ranges[1] - result.ranges[0]), some),
    ):
        length = real.shape[axis]
        cells = np.arange(length) if axis else tried
        most = min(int(SHIFTS[name] / step), length // 2)
        if not most:
            continue
        shifts, values = np.arange(-most, most + 1), []
        for shift in shifts:
            kept = cells[(cells >= shift) & (cells - shift < length)]  # overlap after the shift
            values.append(_mean(correlation(maps[0].take(kept, axis), maps[1].take(kept - shift, axis))))
        found[name] = (shifts * step, np.array(values))
    return found


def _mean(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else 0.0


def _distances(real: np.ndarray, twin: np.ndarray) -> tuple[float, float]:
    one, other = patch_statistics(real), patch_statistics(twin)
    half = len(one) // 2
    own = frechet_distance(np.concatenate(one[:half]), np.concatenate(one[half:])) if half else np.nan
    return frechet_distance(np.concatenate(one), np.concatenate(other)), own
