"""Load recordings from any file with a radar's samples."""

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any, Literal, Protocol, TypedDict, Unpack, cast

import numpy as np

from radarize.io.errors import InputError, refuse_unknown
from radarize.io.importers import Given, captures, import_recording
from radarize.io.recording import Clip, Recording, in_temporary_file
from radarize.radar.config import RadarConfig
from radarize.radar.presets import load_config

#: Frames, or a recording (open, or its file) for all its frames.
Source = Clip | Recording | str | Path
_HDF5 = b"\x89HDF"


class Samples(Protocol):
    """Interface of frames that maps and points are computed from: frames of a recording or a live frame; see `Clip`."""

    @property
    def numbers(self) -> range: ...
    @property
    def times(self) -> np.ndarray: ...
    @property
    def samples(self) -> np.ndarray: ...
    @property
    def valid(self) -> np.ndarray: ...
    @property
    def config(self) -> RadarConfig: ...
    @property
    def alone(self) -> bool: ...
    def __len__(self) -> int: ...
    def __getitem__(self, frames: slice, /) -> "Samples": ...


class CaptureOptions(TypedDict, total=False):
    """Settings of a foreign file that it does not contain; the options of ``radarize import``."""

    config: str | Path | RadarConfig | None
    poses: Path | None
    shape: str | None
    variable: str | None
    latency: float | None
    imu_turn: str | tuple[float, float, float] | None
    walk: int | None
    capture: int | None
    align: bool
    samples: int | None
    loops: int | None
    rx: int | str | None
    tx: int | str | None
    iq_order: Literal["iiqq", "qqii"] | None
    encoding: Literal["signed", "offset-binary"]
    layout: Literal["pairs", "interleaved", "real"]
    board: str | None
    start_frequency: float | None
    slope: float | None
    sample_rate: float | None
    idle_time: float | None
    adc_start_time: float | None
    ramp_end_time: float | None
    frame_period: float | None
    start_time: float | None


def load(
    source: str | Path,
    output: str | Path | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
    **given: Unpack[CaptureOptions],
) -> Recording:
    """Open a recording, or convert another capture to one.

    Samples are read from the file on access. A capture of another format is first converted to a recording: `output`,
        or
    a temporary file that is deleted with the object.

    Args:
        source: a recording (``.h5``), or any source of ``radarize import``: a DCA1000 ``.bin`` with its ``.cfg`` beside
            it, a ``.pcap``, a folder of mmWave Studio, a ROS bag, an array of samples (``.npy``, ``.npz``, ``.mat``).
        output: recording to write (``.h5``), for a capture of another format.
        progress: called with (frames done, frames in all).
        given: settings that the capture does not contain, named as the options of ``radarize import``: ``config`` (a
            preset, a ``.cfg`` or ``.mmwave.json`` file, or a `RadarConfig`), ``poses`` (true poses, a TUM file),
            ``samples``, ``loops``, ``rx`` and ``tx`` (a count, or TI's antenna numbers as in ``"1,3,2"``), ... in SI
            units. A recording takes ``board``, a file that `calibrate` wrote.

    Returns:
        A recording: ``len(rec)`` frames, ``rec[100:110]`` some of them, ``rec.truth`` the true trajectory or None,
        ``rec.config`` the radar's configuration, ``rec.times`` (frame,) s.

    Raises:
        InputError: no such file, an unknown format, a damaged file, or settings that do not fit it.

    Example:
        >>> rec = rz.load("walk.h5")
        >>> rec
        <recording walk.h5: 24 frames of 33.33 ms, scene corner; ...>
        >>> rec[4:8].samples.shape  # frame, loop, transmitter, receiver, sample, I and Q
        (4, 32, 3, 4, 96, 2)
    """
    path = Path(source)
    if _is_recording(path):
        named = [name for name in given if name != "board"] + (["output"] if output is not None else [])
        if named:
            raise InputError(f"{path}: is a recording, but {', '.join(named)} is given, expected none but a board")
        return Recording(path, given.get("board"))
    settings, report = _settings(given), progress or (lambda done, total: None)
    if output is not None:
        return Recording(import_recording(path, Path(output), settings, report))
    if settings.capture is None and len(several := captures(path, settings)) > 1:
        listed = "; ".join(several)
        raise InputError(
            f"{path}: holds {len(several)} captures ({listed}), expected capture, 1 to {len(several)}, or an output"
        )
    return in_temporary_file(lambda to: import_recording(path, to, settings, report), f"{path.stem}.h5")


def frames_of(source: Source) -> Clip:
    """Return the frames, or all frames of a recording.

    Raises:
        InputError: not a recording.
    """
    if isinstance(source, Clip):
        return source
    if not isinstance(source, Recording | str | Path):
        raise InputError(f"{source!r} is a {type(source).__name__}, expected a recording, frames of one, or a file")
    return (source if isinstance(source, Recording) else load(source))[:]


def samples_of(source: Samples | Source) -> Samples:
    """Return the frames, or all frames of a recording, or a live frame.

    Raises:
        InputError: there are no samples.
    """
    if not isinstance(source, Clip | Recording | str | Path) and hasattr(source, "numbers"):
        return source
    return frames_of(cast(Source, source))


def _is_recording(path: Path) -> bool:
    if path.suffix in (".h5", ".part"):
        return True
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(_HDF5)) == _HDF5 and path.suffix != ".mat"


def _settings(capture: CaptureOptions) -> Given:
    refuse_unknown(capture, CaptureOptions)
    given: dict[str, Any] = dict(capture)
    config = given.pop("config", None)
    radar, text = (None, "") if config is None else load_config(config)
    own = {each.name: given.pop(each.name) for each in fields(Given) if each.name in given}
    if "imu_turn" in own:
        own["imu_turn"] = _angles(own["imu_turn"])
    overrides = {name: value for name, value in given.items() if value is not None}
    overrides |= {name: _antennas(overrides[name], name) for name in ("rx", "tx") if name in overrides}
    return Given(radar, text, overrides, **own)


def _antennas(value: object, name: str) -> object:
    """Return a count (``3``), or TI's antenna numbers (``1,3,2``) as 0-based ones."""
    if not isinstance(value, str):
        return value
    try:
        numbers = [int(part) for part in value.split(",")]
    except ValueError:
        raise InputError(f"--{name} is {value!r}, expected a count (3) or antenna numbers (1,3,2)") from None
    return numbers[0] if len(numbers) == 1 else tuple(number - 1 for number in numbers)


def _angles(value: str | tuple[float, float, float] | None) -> tuple[float, float, float] | None:
    """Return roll, pitch, yaw, degrees."""
    if not isinstance(value, str):
        return value
    try:
        roll, pitch, yaw = map(float, value.split())
    except ValueError:
        raise InputError(f"--imu-turn is {value!r}, expected three numbers: roll pitch yaw in degrees") from None
    return roll, pitch, yaw
