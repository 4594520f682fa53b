"""Calibration of a radar from an ordinary walk or from a corner reflector, and the board file that stores it."""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import yaml
from jaxtyping import Complex, Float
from scipy.spatial.transform import Rotation

from radarize.io.errors import InputError
from radarize.io.load import Source, frames_of
from radarize.io.recording import Clip
from radarize.io.replacing import replacing
from radarize.pipeline.calibration.cells import Cells, cells_of, uncalibrated
from radarize.pipeline.calibration.channels import Array, Waves, centred, fit_channels
from radarize.pipeline.calibration.egomotion import LEAN, SCALE, SHIFT_LEFT, SHIFT_UP, TILT, EgoMotion, solve
from radarize.pipeline.calibration.mounting import Estimate, height, roll
from radarize.pipeline.calibration.parallax import RangeBias, find_bias
from radarize.pipeline.calibration.target import measure
from radarize.pipeline.calibration.tracks import tracks_of
from radarize.pipeline.odometry import estimate_odometry
from radarize.radar.boards import BOARDS, SUFFIXES, Board, Mounting, load_board
from radarize.radar.cfg import write_cfg
from radarize.radar.config import RadarConfig, firing_name

#: Maximum number of frames: a minute at 30 frames/s, solved in one system of equations.
_LONGEST = 1800
#: Minimum of a walk: frames with a velocity, and path length, m. Limits for a warning: path length, m; turns, rad.
_FRAMES, _WAY, _SHORT, _FEW_TURNS = 60, 1.0, 8.0, np.radians(90.0)
#: Standard errors above which a warning is given: phases, rad RMS; gains, dB RMS; range bias, m.
_PHASE, _GAIN, _BIAS = np.radians(2.0), 0.3, 0.02
#: The scale of azimuth is applied if it differs from 1 by this much and by this number of standard errors; below that
#: the antenna positions of the board file are kept.
_SCALE, _SURE = 0.01, 4.0


@dataclass(frozen=True)
class Calibration:
    """Calibration of a radar, estimated from a recording.

    Attributes:
        config: the radar's, calibrated.
        errors: (tx, rx, 2) standard errors of the channels' gains (dB) and phases (rad), of the enabled channels.
        values: further quantities by name, SI units; NaN with the reason where they are not observable.
        warnings: what makes the estimate poor.
        source: what it was made from, a sentence.

    Example:
        >>> import numpy as np
        >>> found = rz.Calibration(rec.config, np.zeros((3, 4, 2)), {}, [], "nominal values")
        >>> found.board.name, found.gains.shape, found.phases.shape  # dB, rad
        ('iwr1843boost', (3, 4), (3, 4))
    """

    config: RadarConfig
    errors: Float[np.ndarray, "tx rx 2"]
    values: dict[str, Estimate]
    warnings: list[str]
    source: str

    @property
    def board(self) -> Board:
        """The board with its calibration."""
        return load_board(self.config.board)

    @property
    def gains(self) -> Float[np.ndarray, "tx rx"]:
        """Gains of the enabled channels, dB relative to their mean."""
        levels = -20 * np.log10(np.abs(self.config.calibration))
        return levels - levels.mean()

    @property
    def phases(self) -> Float[np.ndarray, "tx rx"]:
        """Phases of the enabled channels, rad relative to their mean, without the nominal signs of the board."""
        signs = self.board.signs[self.config.channels]
        return -centred((self.config.calibration * signs).ravel()).reshape(self.config.calibration.shape)

    @property
    def tables(self) -> list[tuple[tuple[str, ...], list[tuple[object, ...]], tuple[int, ...]]]:
        """Tables of the channels and of the other quantities, for `radarize.io.console.print_table`."""
        gain, phase = np.moveaxis(self.errors, -1, 0)
        channels: list[tuple[object, ...]] = [
            (
                f"{firing_name(tx)} RX{rx + 1}",
                f"{self.gains[i, j]:.2f} +- {gain[i, j]:.2f}",
                f"{np.degrees(self.phases[i, j]):.1f} +- {np.degrees(phase[i, j]):.1f}",
            )
            for i, tx in enumerate(self.config.tx)
            for j, rx in enumerate(self.config.rx)
        ]
        rest: list[tuple[object, ...]] = [
            (name.replace("_", " "), *_shown(name, each)) for name, each in self.values.items()
        ]
        return [
            (("channel", "gain, dB", "phase, deg"), channels, (1, 2)),
            (("quantity", "value", "unit"), rest, (1,)),
        ]

    def save(self, path: str | Path) -> Path:
        """Write a board file (``.yaml``), or a ``.cfg`` with ``compRangeBiasAndRxChanPhase``.

        Raises:
            InputError: another suffix, or it cannot be written.
        """
        path = Path(path)
        if path.suffix == ".cfg":
            # The firmware's factors are 16-bit fractions with magnitude up to 1.
            factors = self.config.channel_factors / np.abs(self.config.channel_factors).max()
            plain = self.board.model_copy(update=_UNMEASURED)
            known = plain.name if BOARDS.get(plain.name) == plain else plain
            update = {"channel_calibration": _pairs(factors), "board": known}
            text = write_cfg(self.config.model_copy(update=update))
        elif path.suffix in SUFFIXES:
            remarks = [
                self.source,
                *(" ".join((f"{name}:", *_shown(name, each))) for name, each in self.values.items()),
            ]
            fields = self.board.model_dump(mode="json", exclude_none=True, exclude={"name"})
            text = "".join(f"# {remark}\n" for remark in remarks) + yaml.safe_dump(
                fields, sort_keys=False, default_flow_style=None, width=120
            )
        else:
            raise InputError(f"--output is {path}, expected a board file (.yaml) or a radar configuration (.cfg)")
        with replacing(path) as part:
            part.write_text(text, encoding="utf-8")
        return path


_UNMEASURED = {"calibration": None, "range_bias": 0.0, "mounting": None}


def calibrate(
    recording: Source,
    output: str | Path | None = None,
    *,
    target: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Calibration:
    """Calibrate gains and phases of the channels, range bias, azimuth scale, and mounting of a radar.

    Without `target`, the calibration uses an ordinary walk of about 20 s and no reflector: in a static world the
        closing
    speed of an echo determines its direction, and the change of that direction as the sensor passes determines its
    distance. With `target`, it uses a corner reflector straight ahead of a radar that stands still, as TI's demo does.

    Args:
        recording: a recording or a file, or a part of one, of which the first 1800 frames are used. Existing
            calibration in it is ignored.
        output: board file to write (``board.yaml``, for ``--board``), or ``radar.cfg``.
        target: distance of a corner reflector straight ahead, m; None: a walk.
        progress: called with (frames done, frames in all).

    Returns:
        ``.config`` and ``.board`` with the calibration; ``.gains`` (dB) and ``.phases`` (rad) of the channels and their
        standard ``.errors``; ``.values`` of the other quantities; ``.warnings``; ``.save(path)``.

    Raises:
        InputError: samples are missing, the sensor hardly moves (with a target: moves), or there are no echoes.

    Example:
        >>> rz.calibrate(rec)
        Traceback (most recent call last):
        ...
        radarize.io.errors.InputError: ...walk.h5: has 414 echoes in 24 frames, expected a walk of about 20 s ...
    """
    frames = frames_of(recording)[:_LONGEST]
    if not frames.recording.has_samples:
        raise InputError(f"{frames.recording.path}: has no raw samples, expected a recording with /radar/adc")
    found = _walk(frames, progress or (lambda done, total: None)) if target is None else _reflector(frames, target)
    if output is not None:
        found.save(output)
    return found


def recalibrated(frames: Clip, config: RadarConfig) -> Clip:
    """Return the frames as if they had been recorded with another configuration of the same radar."""
    recording = copy(frames.recording)
    recording.config = config
    return Clip(recording, frames.numbers, frames.alone)


def _reflector(frames: Clip, distance: float) -> Calibration:
    seen = measure(frames, distance)
    values = {"range_bias": Estimate(seen.bias, seen.bias_error)}
    config = _calibrated(uncalibrated(frames.config), seen.factors, values, None)
    source = f"{frames.recording.path.name}: corner reflector at {distance:g} m, {seen.frames} frames"
    return _judged(Calibration(config, _by_channel(seen.error, config), values, [], source))


def _walk(frames: Clip, progress: Callable[[int, int], None]) -> Calibration:
    config, path, period = uncalibrated(frames.config), frames.recording.path, frames.config.frame_period
    array = Array(config)
    if 0 not in array.axes:
        raise InputError(
            f"{path}: has {len(array.positions)} channel(s) and no row of antennas, expected antennas side by side"
        )
    cells = cells_of(frames, progress)
    expected = "expected a walk of about 20 s past walls and furniture"
    if len(cells) < 10 * _FRAMES:
        raise InputError(f"{path}: has {len(cells)} echoes in {len(frames)} frames, {expected}")
    cells = replace(cells, frame=cells.frame - cells.frame[0])
    channels = fit_channels(cells, array)
    motion = solve(cells, channels.waves, array, config, int(cells.frame[-1]) + 1)
    seen, way = int(motion.seen.sum()), float(np.hypot(*motion.velocity[motion.seen, :2].T).sum() * period)
    if seen < _FRAMES or way < _WAY:
        raise InputError(f"{path}: has {way:.1f} m of motion in {seen} of {len(frames)} frames, {expected}")
    factors = channels.factors * array.wave(motion.values[None, :2])[0]
    bias, yaw = _range_bias(frames, _calibrated(config, factors, {}, None), cells, channels.waves, motion)
    if 1 in array.axes:
        floor = height(cells, channels.waves, motion, bias.value)
        tilt, lean = (Estimate(motion.values[k], motion.error[k]) for k in (TILT, LEAN))
    else:
        floor = tilt = lean = Estimate(why="the array has no elevation")
    ahead, lever = roll(motion, yaw, period)
    values = {
        "range_bias": Estimate(bias.value, bias.error) if np.isfinite(bias.error) else Estimate(why=_NO_PARALLAX),
        "azimuth_scale": Estimate(1 + motion.values[SCALE], motion.error[SCALE]),
        "height": floor, "tilt": tilt, "lean": lean, "yaw": ahead, "lever_arm": lever,
    }  # fmt: skip
    config = _calibrated(config, factors, values, motion)
    # Contribution of the errors of the shifts to the phases along the array.
    along = 2 * np.pi * (array.positions - array.positions.mean(axis=0)) * motion.error[[SHIFT_LEFT, SHIFT_UP]]
    error = channels.error.copy()
    error[:, 1] = np.sqrt(error[:, 1] ** 2 + (along**2).sum(axis=1))
    turned = float(np.ptp(yaw))
    warnings = [f"the walk is short: {way:.1f} m, expected {_SHORT:g} m or more"] if way < _SHORT else []
    warnings += [f"the walk turns by {np.degrees(turned):.0f} deg, expected 90 deg"] if turned < _FEW_TURNS else []
    source = f"{path.name}: walk of {way:.1f} m, {seen} frames with velocity, {bias.tracks} points with parallax"
    return _judged(Calibration(config, _by_channel(error, config), values, warnings, source))


_NO_PARALLAX = "no point has an observable parallax"


def _range_bias(
    frames: Clip, config: RadarConfig, cells: Cells, waves: Waves, motion: EgoMotion
) -> tuple[RangeBias, Float[np.ndarray, "frame"]]:
    """Return the range bias and the heading at each frame. A bias blurs the map of odometry, so odometry runs twice."""
    period = config.frame_period
    times = cells.time[0] + period * np.arange(len(motion.velocity))
    for _ in range(2):
        track = estimate_odometry(recalibrated(frames, config), "doppler")
        turned = np.unwrap(Rotation.from_quat(track.pose[:, 3:]).as_euler("ZYX")[:, 0])
        yaw = np.interp(times, track.time, turned)
        tracks = tracks_of(cells, waves, motion, np.gradient(yaw) / period, period)
        found = find_bias(cells, tracks, motion, yaw, period)
        if abs(found.value - config.range_bias) < _BIAS or not np.isfinite(found.error):
            break
        config = config.model_copy(update={"range_bias": round(found.value, 5)})
    return found, yaw


def _calibrated(
    config: RadarConfig, factors: Complex[np.ndarray, "antenna"], values: dict[str, Estimate], motion: EgoMotion | None
) -> RadarConfig:
    """Return the configuration with a measured board."""
    board = load_board(config.board)
    whole = np.array([complex(*pair) for pair in board.nominal_calibration]).reshape(board.signs.shape)
    measured = 1 / factors * np.exp(1j * np.angle(factors.sum()))
    whole[config.channels] *= (measured / np.exp(np.log(np.abs(measured)).mean())).reshape(len(config.tx), -1)
    update: dict[str, object] = {"calibration": _pairs(whole)}
    known = {name: round(float(each.value), 5) for name, each in values.items() if not each.why}
    if "range_bias" in known:
        update["range_bias"] = known["range_bias"]
    if motion is not None:
        update["mounting"] = Mounting(**{name: known.get(name) for name in Mounting.model_fields})
        scale = values["azimuth_scale"]
        if abs(scale.value - 1) > max(_SCALE, _SURE * scale.error):
            update["design_frequency"] = board.design_frequency * scale.value
    board = board.model_copy(update=update)
    return config.model_copy(update={"board": board, "range_bias": board.range_bias, "channel_calibration": None})


def _pairs(factors: Complex[np.ndarray, "tx rx"]) -> tuple[tuple[float, float], ...]:
    return tuple((round(float(f.real), 5), round(float(f.imag), 5)) for f in factors.ravel())


def _by_channel(error: np.ndarray, config: RadarConfig) -> Float[np.ndarray, "tx rx 2"]:
    return error.reshape(len(config.tx), len(config.rx), 2)


def _judged(found: Calibration) -> Calibration:
    """Return the calibration with warnings about large standard errors."""
    gain, phase = np.sqrt(np.square(found.errors).mean(axis=(0, 1)))
    bias, warnings = found.values["range_bias"], list(found.warnings)
    if phase > _PHASE:
        warnings.append(f"phases have a standard error of {np.degrees(phase):.1f} deg: walk longer, past more objects")
    if gain > _GAIN:
        warnings.append(f"gains have a standard error of {gain:.2f} dB: walk longer, past more objects")
    if bias.why:
        warnings.append(f"the range bias is not observable ({bias.why}) and set to 0 m")
    elif bias.error > _BIAS:
        warnings.append(
            f"the range bias has a standard error of {bias.error:.3f} m: pass more furniture at a distance of 1 to 3 m"
        )
    return replace(found, warnings=warnings)


#: Units of the other quantities in tables and files, and factors from SI units to them.
_UNITS = {
    "range_bias": ("m", 1.0), "azimuth_scale": ("", 1.0), "height": ("m", 1.0), "lever_arm": ("m", 1.0),
    **dict.fromkeys(("tilt", "lean", "yaw"), ("deg", 180 / np.pi)),
}  # fmt: skip


def _shown(name: str, each: Estimate) -> tuple[str, str]:
    """Return value with standard error, and unit; or why it is not observable."""
    unit, factor = _UNITS[name]
    return (
        ("not observable", each.why) if each.why else (f"{factor * each.value:.3f} +- {factor * each.error:.3f}", unit)
    )
