"""Import of sequences of the red-rover rig in its `roverd` layout, as in the data set I/Q-1M (Huang et al., 2025).

SEQUENCE/config.yaml          configuration of the rig; radar: args: radar: chirps, in GHz, MHz/us, us, ksps and ms
         radar/meta.json      type and shape of each channel; iq: [loop, tx, rx, 2 x sample] of int16
         radar/radar.json     range and Doppler resolution, m and m/s; in our exports also the order of transmitters
         radar/iq, ts         words of the radar frame by frame; stamps, s
         radar/valid          0 of frames in which lost packets were filled with zeros
         _radar/pose.npz      poses by a lidar's SLAM: t (s), pos (m), rot (matrices); x forward, y left, z up
"""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Int16
from scipy.spatial.transform import Rotation

from radarize.io.errors import InputError, explained
from radarize.io.files import read_text, regular
from radarize.io.importers.capture import Capture, CapturedFrames, batch_frames
from radarize.io.importers.format import Format
from radarize.io.importers.parameters import AFTER_ADC, ASSUMED, Given
from radarize.io.jsonfile import parse_json
from radarize.io.npyfile import read_npz
from radarize.io.recording import Product
from radarize.io.yamlfile import read_yaml
from radarize.radar.config import SPEED_OF_LIGHT, RadarConfig, fired
from radarize.radar.dca1000 import check_layout, decode

#: Firing transmitters; with two, the elevated one in the middle of the row is left out.
_TRANSMITTERS = {1: (0,), 2: (0, 2), 3: (0, 1, 2)}
#: Fields of a configuration: names in config.yaml, and units.
_FIELDS = {
    "start_frequency": ("frequency", 1e9), "slope": ("freq_slope", 1e12), "sample_rate": ("sample_rate", 1e3),
    "idle_time": ("idle_time", 1e-6), "adc_start_time": ("adc_start_time", 1e-6),
    "ramp_end_time": ("ramp_end_time", 1e-6), "frame_period": ("frame_period", 1e-3),
}  # fmt: skip
#: Length of an aligned run of zero words that occurs only where packets were lost.
_RUN = 16


class _Channel(NamedTuple):
    """A file with the data of consecutive frames."""

    path: Path
    dtype: np.dtype
    shape: tuple[int, ...]

    @property
    def frames(self) -> int:
        """Number of complete frames; a recording may end within one."""
        return regular(self.path, "a channel of a roverd sensor").stat().st_size // self.frame_bytes

    @property
    def frame_bytes(self) -> int:
        return math.prod(self.shape) * self.dtype.itemsize

    def read(self, start: int, stop: int) -> np.ndarray:
        """Read some frames."""
        with explained(f"{self.path}: cannot be read", OSError), self.path.open("rb") as file:
            file.seek(start * self.frame_bytes)
            data = file.read((stop - start) * self.frame_bytes)
        return np.frombuffer(data, self.dtype).reshape(-1, *self.shape)


def is_sequence(source: Path) -> bool:
    """Return whether a folder is a sequence in roverd's layout."""
    return (source / "radar" / "meta.json").is_file()


def open_sequence(source: Path, given: Given) -> Capture:
    """Open a sequence; chirps with zeros from lost packets are marked as not valid.

    Raises:
        InputError: not in this layout, a channel of another type, or chirps that do not fit its shape.
    """
    sensor = source / "radar"
    meta = parse_json(read_text(sensor / "meta.json", "JSON"), str(sensor / "meta.json"))
    words, stamps = (_channel(sensor, meta, name, kind) for name, kind in (("iq", "<i2"), ("ts", "<f8")))
    if len(words.shape) != 4 or words.shape[1] not in _TRANSMITTERS or words.shape[3] % 2:
        raise InputError(f"{words.path}: has shape {words.shape}, expected loops, 1 to 3 tx, rx and twice the samples")
    loops, tx, rx, numbers = words.shape
    found: dict[str, Any] = {"loops": loops, "tx_order": _TRANSMITTERS[tx], "rx": rx, "samples": numbers // 2}
    computed = _intrinsics(sensor / "radar.json")
    chirps = _chirps(source / "config.yaml") | found
    overrides = {name: value for name, value in given.overrides.items() if value is not None}
    config, assumed = given.configure(str(source), _resolved(chirps | overrides, computed) | chirps)
    fired = _fired(sensor / "radar.json", computed, config)
    if "tx_order" in computed:
        config = config.model_copy(update={"tx_order": config.tx})  # in our exports words are in the order of antennas
    check_layout(config)
    if (config.loops, len(config.tx), len(config.rx), 2 * config.samples) != words.shape:
        raise InputError(f"{words.path}: has shape {words.shape}, expected that of the configuration's frames")
    for channel in (words, stamps):
        if not channel.frames:
            size = channel.path.stat().st_size
            raise InputError(f"{channel.path}: has {size} bytes, expected {channel.frame_bytes} a frame")
    count = min(words.frames, stamps.frames)
    doubtful = np.zeros(count, bool)
    if "valid" in meta:
        whole = _channel(sensor, meta, "valid", "u1").read(0, count)
        doubtful[: len(whole)] = whole == 0
    capture = Capture(fired, "", (), count, assumed, products=_poses(source / "_radar" / "pose.npz"))
    capture.warnings += _contradictions(sensor / "radar.json", computed, config)
    capture.batches = _batches(words, stamps, doubtful, config)
    return capture


def _channel(sensor: Path, meta: dict, name: str, kind: str) -> _Channel:
    """Return a channel of plain numbers.

    Raises:
        InputError: there is none, or it has another type.
    """
    about = meta.get(name)
    shape = about.get("shape") if isinstance(about, dict) else None
    if (
        not isinstance(about, dict)
        or not isinstance(shape, list)
        or not all(isinstance(size, int) and 0 < size <= 1 << 16 for size in shape)
    ):
        raise InputError(f"{sensor / 'meta.json'}: {name} is {str(about)[:80]}, expected format, type and shape")
    with explained(f"{sensor / 'meta.json'}: {name}: type", TypeError, ValueError):
        dtype = np.dtype(str(about.get("type"))).newbyteorder("<")
    if about.get("format") != "raw" or dtype != np.dtype(kind):
        found = f"{about.get('format')} {about.get('type')}"
        raise InputError(f"{sensor / 'meta.json'}: {name} is {found[:40]}, expected raw {np.dtype(kind).name}")
    return _Channel(sensor / name, dtype, tuple(shape))


def _chirps(path: Path) -> dict[str, object]:
    """Return the chirp parameters in the rig's configuration; empty without a file.

    Raises:
        InputError: a parameter is missing or not a number.
    """
    if not path.exists():
        return {}
    settings = read_yaml(path)
    for key in ("radar", "args", "radar"):
        settings = settings.get(key) if isinstance(settings, dict) else None
    if not isinstance(settings, dict):
        raise InputError(f"{path}: has no radar: args: radar:, expected the chirps of the radar there")
    found: dict[str, object] = {}
    for field, (name, unit) in _FIELDS.items():
        if not isinstance(value := settings.get(name), int | float) or isinstance(value, bool):
            raise InputError(f"{path}: radar.args.radar.{name} is {str(value)[:40]}, expected a number")
        found[field] = float(f"{value * unit:.12g}")  # 20 us is 2e-05, not 1.9999999999999998e-05
    return found


def _intrinsics(path: Path) -> dict[str, Any]:
    """Return the resolutions that the rig's program computed from its chirps; empty without a file.

    Raises:
        InputError: the file is not JSON, or a resolution is not a positive number.
    """
    if not path.exists():
        return {}
    found = parse_json(read_text(path, "JSON"), str(path))
    for name in ("range_resolution", "doppler_resolution"):
        value = found.get(name, 1.0)
        if not isinstance(value, int | float) or isinstance(value, bool) or not 1e-6 < value < 1e6:
            raise InputError(f"{path}: {name} is {str(value)[:40]}, expected a positive number")
    return found


def _resolved(chirps: dict[str, Any], computed: dict[str, Any]) -> dict[str, Any]:
    """Return slope (Hz/s) and idle time (s) that give the resolutions, given or assumed values for the other
    parameters."""
    found: dict[str, Any] = {}
    fields: dict[str, Any] = ASSUMED | chirps
    window = fields["samples"] / fields["sample_rate"]
    if "range_resolution" in computed:
        found["slope"] = SPEED_OF_LIGHT / (2 * computed["range_resolution"] * window)
    if "doppler_resolution" in computed:
        slope = fields["slope"] if "slope" in chirps else found.get("slope", fields["slope"])
        frequency = fields["start_frequency"] + slope * (fields["adc_start_time"] + window / 2)
        chirp = (
            SPEED_OF_LIGHT
            / frequency
            / (2 * computed["doppler_resolution"] * fields["loops"] * len(fields["tx_order"]))
        )
        ramp = fields.get("ramp_end_time", fields["adc_start_time"] + window + AFTER_ADC)
        if chirp > ramp:
            found["idle_time"] = chirp - ramp
    return found


def _fired(path: Path, computed: dict[str, Any], config: RadarConfig) -> RadarConfig:
    """Return the configuration with the firing order of transmitters; words are in the order of antennas.

    Raises:
        InputError: the order does not contain exactly these transmitters.
    """
    order = computed.get("tx_order")
    if order is None or len(config.tx_order) != len(set(config.tx)):
        return config
    names = [fired(tx)[0] + 1 for tx in config.tx]
    if not isinstance(order, list) or sorted(map(str, order)) != [str(name) for name in names]:
        raise InputError(f"{path}: tx_order is {str(order)[:40]}, expected {names} in any order")
    return config.changed(str(path), tx_order=tuple(int(tx) - 1 for tx in order))


def _contradictions(path: Path, computed: dict[str, Any], config: RadarConfig) -> list[str]:
    """Return warnings where the configuration and the resolutions computed by the rig's program differ by more than 1
    %."""
    own = {"range_resolution": config.range_resolution, "doppler_resolution": config.velocity_resolution}
    return [
        f"{path}: {name} is {computed[name]:.6g}, but the configuration has {value:.6g}"
        for name, value in own.items()
        if name in computed and abs(computed[name] / value - 1) > 0.01
    ]


def _poses(path: Path) -> dict[str, Product]:
    """Return the true poses in the sequence, if there are any.

    Raises:
        InputError: poses are missing, or their arrays differ in length.
    """
    if not path.exists():
        return {}
    found = read_npz(path, str(path), ("t", "pos", "rot"), path.stat().st_size)
    shapes = {name: values.shape for name, values in found.items()}
    count = len(found["t"]) if "t" in found and found["t"].ndim == 1 else 0
    if not count or shapes != {"t": (count,), "pos": (count, 3), "rot": (count, 3, 3)}:
        raise InputError(f"{path}: has {shapes}, expected t, pos (3 numbers) and rot (3 x 3) of as many poses")
    if not all(np.isfinite(values).all() for values in found.values()) or (np.diff(found["t"]) <= 0).any():
        raise InputError(f"{path}: has poses that are not finite, or times that do not ascend")
    with explained(f"{path}: rot", ValueError):
        turned = Rotation.from_matrix(found["rot"]).as_quat()
    return {
        "truth/time": Product(found["t"].astype(float), "s", "stamps of the poses"),
        "truth/pose": Product(
            np.hstack([found["pos"], turned]), "m; x y z qx qy qz qw", "of the rig, by SLAM with its lidar"
        ),
    }


def _batches(
    words: _Channel, stamps: _Channel, doubtful: Bool[np.ndarray, "frame"], config: RadarConfig
) -> Iterator[CapturedFrames]:
    size = batch_frames(config)
    for start in range(0, len(doubtful), size):
        stop = min(start + size, len(doubtful))
        frames = words.read(start, stop)
        lost = _filled(frames)[:, :, list(config.slot)] & doubtful[start:stop, None, None]
        yield CapturedFrames(
            decode(frames.reshape(-1).astype(np.int16), config), ~lost, stamps.read(start, stop).reshape(-1)
        )


def _filled(words: Int16[np.ndarray, "frame loop tx rx word"]) -> Bool[np.ndarray, "frame loop tx"]:
    """Return whether each chirp has a run of zeros."""
    chirps = words.reshape(*words.shape[:3], -1)
    runs = chirps[..., : chirps.shape[3] // _RUN * _RUN].reshape(*words.shape[:3], -1, _RUN)
    return np.any(~np.any(runs, axis=4), axis=3)


FORMAT = Format(
    "sequence in roverd's layout",
    "a sequence in roverd's layout",
    is_sequence,
    lambda source, given, _: open_sequence(source, given),
)
