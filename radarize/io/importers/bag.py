"""Import of ROS bags with raw radar frames: those of the published Radarize data set (ROS 1), and ROS 2 bags with the
same topics.

Other topics are stamped from their headers, or from their receipt if headers are not on the bag's clock.
"""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from radarize.io.errors import InputError, explained
from radarize.io.importers.bin import all_zero, configured
from radarize.io.importers.capture import Capture, CapturedFrames, batch_frames
from radarize.io.importers.companions import ChipPoints, Companion, Depth, InertialSensor, TrackedPose
from radarize.io.importers.format import Format
from radarize.io.importers.frames import BagFrames, Stamps
from radarize.io.importers.parameters import Given
from radarize.io.importers.rosbag import Bag, Message, is_frame
from radarize.radar.cfg import numbers
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import check_layout, decode
from radarize.radar.presets import PRESETS

#: Further topics of the data set: name, message types, and reader. If there is no topic of the name, the only one of
#: the type is used.
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
#: Assumption for frames with the shape of the Radarize data set, which was recorded with this board.
OF_RADARIZE = "configuration: preset radarize"
_CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
#: s, by which other topics are read ahead of the frames; maximum delay of received messages.
_AHEAD = 0.5


def open_bag(path: Path, given: Given) -> Capture:
    """Open a ROS bag.

    The radar configuration is the given one, else that of the data set (preset ``radarize``) if the frames have its
    size, else from the frames and the user's options. Range bias and channel calibration come from the frames.

    Args:
        path: a ROS 1 ``.bag``, the folder of a ROS 2 bag, or its ``.mcap`` or ``.db3``.
        given: settings of the radar and its latency.

    Raises:
        InputError: not a readable bag, one without raw frames, or frames that do not fit the configuration.
    """
    with Bag(path) as bag:
        radar, others, warnings = _topics(bag)
        _, first = _first(bag, radar)
        config, assumed = _configure(path, first, given)
        config = _calibrated(config, first, str(path), warnings)
        companions = {}
        for topic, kind in others.items():
            try:
                companions[topic] = kind(config, _first(bag, topic)[1])
            except InputError as error:
                warnings.append(f"{topic} is left out: {error}")
        _intrinsics(bag, companions)
        received = bag.receipts(radar)
    unknown = _turned(companions, given)
    taken = list(companions.values())
    check_layout(config)
    stamps = Stamps(config, first, received, given.latency)
    capture = Capture(config, given.cfg_text, (), len(received), (*assumed, *stamps.assumed, *unknown), warnings)
    capture.board_known = OF_RADARIZE in assumed
    capture.attributes["stamps"] = str(stamps)
    capture.streams = {name: stream for companion in taken for name, stream in companion.streams.items()}
    capture.products = {name: product for companion in taken for name, product in companion.products.items()}
    capture.attributes["topics"] = ", ".join([radar, *companions])
    capture.batches = _batches(path, radar, companions, capture, stamps)
    return capture


def _first(bag: Bag, topic: str) -> tuple[float, Message]:
    """Return time of receipt (s) and content of a topic's first message."""
    for _, nanoseconds, message in bag.messages([topic]):
        return 1e-9 * nanoseconds, message
    raise InputError(f"{bag.path}: has no message on {topic}, though its index counts {bag.topics[topic][1]}")


def _topics(bag: Bag) -> tuple[str, dict[str, type[Companion]], list[str]]:
    """Return the topic of raw frames, the other topics to read, and warnings about ambiguity."""
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
        warnings.append(f"{bag.path}: has raw frames on {', '.join(frames)}, of which one is used")
    radar = _RADAR if _RADAR in frames else frames[0]
    others = {}
    for name, kinds, companion in COMPANIONS:
        found = [topic for topic, kind in there.items() if kind in kinds]
        if companion is Depth:
            found = [topic for topic in found if "depth" in topic.lower()]
        if name in found or len(found) == 1:
            others[name if name in found else found[0]] = companion
        elif found:
            warnings.append(f"{bag.path}: has {', '.join(found)}, none of them {name}; all are left out")
    return radar, others, warnings


def _configure(path: Path, frame: Message, given: Given) -> tuple[RadarConfig, tuple[str, ...]]:
    with explained(f"{path}: has frames without usable shape, rx, tx and data"):
        shape = tuple(int(length) for length in np.atleast_1d(frame.shape))
        rx, tx = _antennas(frame.rx), _antennas(frame.tx)
        whole = np.asarray(frame.data).dtype.kind in "iu" and min(shape, default=0) > 0
    loops, rest = divmod(math.prod(shape), max(1, shape[-1] * len(rx) * len(tx))) if whole else (0, 0)
    if rest or not loops:
        raise InputError(
            f"{path}: has frames of shape {shape} with {len(tx)} transmitters and {len(rx)} receivers, expected loops "
            "x transmitters x receivers x samples"
        )
    found = {"samples": shape[-1], "loops": loops, "rx": rx, "tx": tx}
    preset = PRESETS["radarize"]
    if given.config is None and found == {name: getattr(preset, name) for name in found}:
        return given.or_else(preset, "").configure(str(path))[0], (OF_RADARIZE, "iq_order")
    return given.configure(str(path), found)


def _antennas(field: int | np.ndarray) -> tuple[int, ...]:
    """Return the enabled antennas, 0-based, from a bit mask or from one truth value per antenna."""
    values = [int(value) for value in np.atleast_1d(field)]
    if len(values) == 1 and values[0] > 1:
        return numbers(values[0])
    return tuple(k for k, value in enumerate(values) if value)


def _calibrated(config: RadarConfig, frame: Message, name: str, warnings: list[str]) -> RadarConfig:
    """Return the configuration with the frame's calibration, unless it has one already."""
    with explained(f"{name}: has frames without usable range_bias and rx_phase_bias"):
        pairs = np.asarray(getattr(frame, "rx_phase_bias", ()), float).reshape(-1)
        bias = float(getattr(frame, "range_bias", 0.0))
    untouched = config.range_bias == 0 and config.channel_calibration is None
    if not untouched or not pairs.any():
        return config
    channels = config.channel_factors.size
    if pairs.size != 2 * channels or not np.isfinite([*pairs, bias]).all():
        warnings.append(f"rx_phase_bias has {pairs.size} numbers, expected {channels} pairs; it is not used")
        return config
    factors = tuple((float(re), float(im)) for re, im in pairs.reshape(channels, 2))
    return config.changed(name, range_bias=bias, channel_calibration=factors)


def _intrinsics(bag: Bag, companions: dict[str, Companion]) -> None:
    """Set the depth camera's pinhole model from its camera_info, if the bag has one."""
    for topic, companion in companions.items():
        folder = topic.removesuffix("/compressedDepth").rsplit("/", 1)[0]
        if isinstance(companion, Depth) and bag.topics.get(f"{folder}/camera_info", ("", 0))[0] == _CAMERA_INFO:
            for _, _, info in bag.messages([f"{folder}/camera_info"]):
                matrix = np.asarray(info.K if hasattr(info, "K") else info.k, float)
                if matrix[0] > 0:
                    companion.calibrate((matrix[0], matrix[4], matrix[2], matrix[5]))
                break


def _turned(companions: dict[str, Companion], given: Given) -> tuple[str, ...]:
    """Rotate the IMU as the user states; return ``imu/mount`` if its orientation is unknown."""
    sensors = [companion for companion in companions.values() if isinstance(companion, InertialSensor)]
    for sensor in sensors:
        if given.imu_turn is not None:
            sensor.turn(Rotation.from_euler("xyz", given.imu_turn, degrees=True), "given")
    return ("imu/mount",) if any(not sensor.products for sensor in sensors) else ()


def _batches(
    path: Path, radar: str, companions: dict[str, Companion], capture: Capture, stamps: Stamps
) -> Iterator[CapturedFrames]:
    config, done = capture.config, 0
    size = batch_frames(config, capture.streams)
    frames = BagFrames(config)

    def batch(count: int) -> CapturedFrames:
        nonlocal done
        times, raw, end = frames.take(count)
        rows = [companion.rows(times, done, end) for companion in companions.values()]
        done += len(times)
        return CapturedFrames(
            decode(raw, config), ~all_zero(raw, config), times, {k: v for part in rows for k, v in part.items()}
        )

    with Bag(path) as bag:
        for topic, nanoseconds, message in bag.messages([radar, *companions]):
            received = 1e-9 * nanoseconds
            now = stamps(message, received) if topic == radar else received
            if frames.times and now > frames.last + 2 * _AHEAD:  # the radar is silent, so nothing else will arrive
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
    capture.warnings += [*frames.warnings, *stamps.warnings]
    for topic, companion in companions.items():
        if companion.damaged:
            capture.warnings.append(f"{topic}: {companion.damaged} messages could not be used")


FORMAT = Format(
    "ROS bag",
    "a ROS bag (.bag, .mcap, .db3 or a folder)",
    lambda source: source.suffix.lower() in (".bag", ".mcap", ".db3") or (source / "metadata.yaml").is_file(),
    lambda source, given, _: open_bag(source, configured(source, given)),
    options=("latency", "imu_turn"),
)
