"""ROS bags of raw radar frames: the published Radarize data set's (ROS 1), and ROS 2 bags with the same topics.

Frames are stamped with the time of their receipt, since their publisher leaves the header's stamp unset.
"""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from radarize.errors import InputError
from radarize.importers.bin import all_zero
from radarize.importers.capture import Batch, Capture, batch_frames
from radarize.importers.companions import ChipPoints, Companion, Depth, InertialSensor, TrackedPose
from radarize.importers.parameters import configure
from radarize.importers.rosbag import Bag, is_frame
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import check_layout, decode
from radarize.radar.presets import PRESETS

#: What may come along: the data set's topic, message types, and who takes it. Where there is no topic of that name,
#: the only one of the type serves.
COMPANIONS: tuple[tuple[str, tuple[str, ...], type[Companion]], ...] = (
    ("/tracking/odom/sample", ("nav_msgs/msg/Odometry",), TrackedPose),
    ("/tracking/imu", ("sensor_msgs/msg/Imu",), InertialSensor),
    ("/ti_mmwave/radar_scan_pcl_0", ("sensor_msgs/msg/PointCloud2",), ChipPoints),
    (
        "/camera/depth/image_rect_raw/compressedDepth",
        ("sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image"),
        Depth,
    ),
)
_RADAR = "/radar0/radar_data"
_CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
#: s: so much of the other topics is read ahead of the frames; messages are received that late at most.
_AHEAD = 0.5


def open_bag(
    path: Path, config: RadarConfig | None, cfg_text: str, overrides: dict[str, object], *, latency: float = 0.0
) -> Capture:
    """Open a bag.

    The radar's configuration is what was given, else the data set's own (preset ``radarize``) if the frames have its
    size, else what the frames say and the user adds. Range bias and channel calibration come from the frames.

    Args:
        path: a ROS 1 ``.bag``, a ROS 2 bag's folder, or its ``.mcap`` or ``.db3``.
        config, cfg_text, overrides: what is known of the radar.
        latency: from a frame's start to its receipt, s.

    Raises:
        InputError: no readable bag, one without raw frames, or frames that do not fit the configuration.
    """
    with Bag(path) as bag:
        radar, others, warnings = _topics(bag)
        first = _first(bag, radar)
        config, assumed = _configure(path, first, config, overrides)
        config = _calibrated(config, first, warnings)
        companions = {}
        for topic, kind in others.items():
            try:
                companions[topic] = kind(config, _first(bag, topic))
            except InputError as error:
                warnings.append(f"{topic} is left out: {error}")
        _intrinsics(bag, companions)
        count = bag.topics[radar][1]
    taken = list(companions.values())
    check_layout(config)
    capture = Capture(config, cfg_text, (), count, (*assumed, *(["latency"] if not latency else [])), warnings)
    capture.streams = {name: stream for companion in taken for name, stream in companion.streams.items()}
    capture.products = {name: product for companion in taken for name, product in companion.products.items()}
    capture.attributes["topics"] = ", ".join([radar, *companions])
    capture.batches = _batches(path, radar, companions, capture, latency)
    return capture


def _first(bag: Bag, topic: str) -> object:
    for _, _, message in bag.messages([topic]):
        return message
    raise InputError(f"{bag.path}: has no message on {topic}, though its index counts {bag.topics[topic][1]}")


def _topics(bag: Bag) -> tuple[str, dict[str, type[Companion]], list[str]]:
    """The topic of raw frames, those that come along, and what was ambiguous."""
    there = {topic: kind for topic, (kind, count) in bag.topics.items() if count}
    frames = [topic for topic, kind in there.items() if is_frame(kind)]
    if not frames:
        listed = ", ".join(f"{topic} ({kind})" for topic, kind in there.items())
        raise InputError(
            f"{bag.path}: has no raw radar frames (messages of a type RadarFrameFull), which odometry and maps are "
            f"made of; expected a topic such as {_RADAR} beside {listed or 'nothing'}"
        )
    warnings = []
    if len(frames) > 1:
        warnings.append(f"{bag.path}: has raw frames on {', '.join(frames)}, of which one is taken")
    radar = _RADAR if _RADAR in frames else frames[0]
    others = {}
    for name, kinds, companion in COMPANIONS:
        found = [topic for topic, kind in there.items() if kind in kinds]
        if companion is Depth:
            found = [topic for topic in found if "depth" in topic.lower()]
        if name in found or len(found) == 1:
            others[name if name in found else found[0]] = companion
        elif found:
            warnings.append(f"{bag.path}: has {', '.join(found)}, none of them {name}, and all are left out")
    return radar, others, warnings


def _configure(
    path: Path, frame: object, config: RadarConfig | None, overrides: dict[str, object]
) -> tuple[RadarConfig, tuple[str, ...]]:
    shape = tuple(int(length) for length in np.atleast_1d(frame.shape))
    rx, tx = _antennas(frame.rx), _antennas(frame.tx)
    loops, rest = divmod(math.prod(shape), max(1, shape[-1] * len(rx) * len(tx)))
    if rest or not loops:
        raise InputError(
            f"{path}: has frames of shape {shape} with {len(tx)} transmitters and {len(rx)} receivers, expected loops "
            "x transmitters x receivers x samples"
        )
    said = {"samples": shape[-1], "loops": loops, "rx": rx, "tx": tx}
    preset = PRESETS["radarize"]
    if config is not None:
        return configure(config, overrides, str(path))
    if (preset.samples, preset.loops, preset.rx, preset.tx) == (shape[-1], loops, rx, tx):
        return configure(preset, overrides, str(path))[0], ("configuration: preset radarize", "iq_order")
    return configure(None, said | overrides, str(path))


def _antennas(field: object) -> tuple[int, ...]:
    """Antennas in use, 0-based, from a bit mask or from one truth value an antenna."""
    values = [int(value) for value in np.atleast_1d(field)]
    if len(values) == 1 and values[0] > 1:
        return tuple(k for k in range(4) if values[0] >> k & 1)
    return tuple(k for k, value in enumerate(values) if value)


def _calibrated(config: RadarConfig, frame: object, warnings: list[str]) -> RadarConfig:
    """The configuration with the frame's calibration, unless it has one of its own."""
    pairs = np.asarray(getattr(frame, "rx_phase_bias", ()), float).reshape(-1)
    untouched = config.range_bias == 0 and set(config.channel_calibration) == {(1.0, 0.0)}
    if not untouched or not pairs.any():
        return config
    if pairs.size != 24 or not np.isfinite(pairs).all():
        warnings.append(f"rx_phase_bias has {pairs.size} numbers, expected 12 pairs; no calibration is taken from it")
        return config
    bias = float(getattr(frame, "range_bias", 0.0))
    factors = tuple((float(re), float(im)) for re, im in pairs.reshape(12, 2))
    return config.model_copy(update={"range_bias": bias, "channel_calibration": factors})


def _intrinsics(bag: Bag, companions: dict[str, Companion]) -> None:
    """Take the depth camera's pinhole model from its camera_info, if the bag has one."""
    for topic, companion in companions.items():
        folder = topic.removesuffix("/compressedDepth").rsplit("/", 1)[0]
        if isinstance(companion, Depth) and bag.topics.get(f"{folder}/camera_info", ("", 0))[0] == _CAMERA_INFO:
            for _, _, info in bag.messages([f"{folder}/camera_info"]):
                matrix = np.asarray(info.K if hasattr(info, "K") else info.k, float)
                if matrix[0] > 0:
                    companion.calibrate((matrix[0], matrix[4], matrix[2], matrix[5]))
                break


class Frames:
    """Raw frames that wait for what comes along with them, and what was wrong with others.

    Args:
        config: radar configuration.
    """

    def __init__(self, config: RadarConfig):
        self.config, self.words = config, config.frame_bytes // 2
        self.times: list[float] = []
        self.raw: list[np.ndarray] = []
        self.last = -np.inf
        self._odd = self._again = self._missing = 0

    def add(self, time: float, message: object) -> None:
        """Keep a frame, unless it has another size or does not come after the last one."""
        words = np.asarray(message.data)
        if words.dtype.itemsize == 1:
            words = words[: words.size // 2 * 2].view("<i2")
        if words.size != self.words:
            self._odd += 1
        elif time <= self.last:
            self._again += 1
        else:
            if np.isfinite(self.last):
                self._missing += max(0, round((time - self.last) / self.config.frame_period) - 1)
            self.last = time
            self.times.append(time)
            self.raw.append(words.astype(np.int16, copy=False))

    def take(self, count: int) -> tuple[np.ndarray, np.ndarray, float]:
        """Stamps and words of the first frames, and the stamp of the frame after them, s."""
        times, raw = np.array(self.times[:count]), np.concatenate(self.raw[:count])
        del self.times[:count], self.raw[:count]
        return times, raw, self.times[0] if self.times else self.last + self.config.frame_period

    @property
    def warnings(self) -> list[str]:
        """What was wrong."""
        counted = (
            (self._odd, f"frames have not the {self.words} words of the configuration and are left out"),
            (self._again, "frames came again or out of order and are left out"),
            (self._missing, "frames are missing between others"),
        )
        return [f"{count} {what}" for count, what in counted if count]


def _batches(
    path: Path, radar: str, companions: dict[str, Companion], capture: Capture, latency: float
) -> Iterator[Batch]:
    config, size, done = capture.config, batch_frames(capture.config), 0
    frames = Frames(config)

    def batch(count: int) -> Batch:
        nonlocal done
        times, raw, end = frames.take(count)
        rows = [companion.rows(times, done, end) for companion in companions.values()]
        done += len(times)
        return Batch(
            decode(raw, config), ~all_zero(raw, config), times, {k: v for part in rows for k, v in part.items()}
        )

    with Bag(path) as bag:
        for topic, nanoseconds, message in bag.messages([radar, *companions]):
            received = 1e-9 * nanoseconds
            now = received - latency
            if frames.times and now > frames.last + 2 * _AHEAD:  # the radar is silent: nothing to wait for
                yield batch(size)
            elif len(frames.times) > size and now > frames.times[size] + _AHEAD:
                yield batch(size)
            elif not frames.times:
                for companion in companions.values():
                    companion.forget(now - 2 * _AHEAD)
            if topic == radar:
                frames.add(now, message)
            else:
                companions[topic].take(message, received)
    while frames.times:
        yield batch(size)
    if not done:
        raise InputError(
            f"{path}: {'; '.join(frames.warnings)}; expected {' x '.join(map(str, config.frame_shape))} words a frame"
        )
    capture.warnings += frames.warnings
    for topic, companion in companions.items():
        if companion.damaged:
            capture.warnings.append(f"{topic}: {companion.damaged} messages could not be used")
