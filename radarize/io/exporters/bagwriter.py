"""ROS 2 bags written through the `rosbags` library, whole or not at all.

Version 8 of the format with sqlite3 storage is what every ROS 2 distribution since Humble plays.
"""

import os
import tempfile
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np
from rosbags.interfaces import Connection, Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

from radarize.io.errors import InputError, explained

_NEVER = QosTime(0, 0)
#: Latched: who subscribes later gets it too, as /tf_static is meant to be.
_LATCHED = Qos(
    QosHistory.KEEP_LAST, 1, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL, _NEVER, _NEVER,
    QosLiveliness.AUTOMATIC, _NEVER, False,
)  # fmt: skip
_TYPES = get_typestore(Stores.ROS2_HUMBLE)


class Message(Protocol):
    """A message of the `rosbags` library."""

    __msgtype__: ClassVar[str]


def message(kind: str, **fields: Any) -> Message:
    """A message of a type such as ``sensor_msgs/msg/Imu``."""
    return _TYPES.types[kind](**fields)


def header(time: float, frame: str) -> Message:
    """A header with a stamp, s, and the frame that its message is given in."""
    nanoseconds = round(1e9 * time)
    stamp = message("builtin_interfaces/msg/Time", sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
    return message("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def vector(values: np.ndarray, kind: str = "Vector3") -> Message:
    """Three or four numbers as ``geometry_msgs`` Vector3, Point or Quaternion."""
    return message(f"geometry_msgs/msg/{kind}", **dict(zip("xyzw", map(float, values), strict=False)))


class BagWriter:
    """A ROS 2 bag that takes its place when it is whole; use as a context manager.

    Args:
        path: folder to write; must not be there, or be empty.

    Raises:
        InputError: it is there, or cannot be written.
    """

    def __init__(self, path: Path):
        self.path = path
        if path.exists() and not (path.is_dir() and not any(path.iterdir())):
            raise InputError(f"{path}: is there already, expected the name of a new folder for the bag")
        with explained(f"{path}: cannot be written", OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._folder = tempfile.TemporaryDirectory(dir=path.parent, prefix=f"{path.name}.part")
            self._writer = Writer(Path(self._folder.name) / path.name, version=8)
            self._writer.open()
        self._connections: dict[str, Connection] = {}

    def __enter__(self) -> "BagWriter":
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: object) -> None:
        with self._folder, explained(f"{self.path}: cannot be written", OSError):
            self._writer.close()
            if kind is None:
                os.replace(Path(self._folder.name) / self.path.name, self.path)

    def write(self, topic: str, time: float, content: Message) -> None:
        """Append a message, received at `time`, s."""
        kind = content.__msgtype__
        if topic not in self._connections:
            latched = (_LATCHED,) if topic == "/tf_static" else ()
            self._connections[topic] = self._writer.add_connection(
                topic, kind, typestore=_TYPES, offered_qos_profiles=latched
            )
        self._writer.write(self._connections[topic], round(1e9 * time), _TYPES.serialize_cdr(content, kind))
