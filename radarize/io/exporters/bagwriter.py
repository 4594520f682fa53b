"""Writer of ROS 2 bags with the `rosbags` library; a bag is complete or absent.

Version 8 of the format with sqlite3 storage is what every ROS 2 distribution since Humble plays.
"""

from contextlib import ExitStack
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np
from rosbags.interfaces import Connection, Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

from radarize.io.replacing import new_folder

_NEVER = QosTime(0, 0)
#: Latched, as /tf_static should be: a later subscriber receives it too.
_LATCHED = Qos(
    QosHistory.KEEP_LAST, 1, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL, _NEVER, _NEVER,
    QosLiveliness.AUTOMATIC, _NEVER, False,
)  # fmt: skip
_TYPES = get_typestore(Stores.ROS2_HUMBLE)


class Message(Protocol):
    """Interface of messages of the `rosbags` library."""

    __msgtype__: ClassVar[str]


def message(kind: str, **fields: Any) -> Message:
    """Return a message of a type such as ``sensor_msgs/msg/Imu``."""
    return _TYPES.types[kind](**fields)


def header(time: float, frame: str) -> Message:
    """Return a header with a stamp, s, and a coordinate frame."""
    nanoseconds = round(1e9 * time)
    stamp = message("builtin_interfaces/msg/Time", sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
    return message("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def vector(values: np.ndarray, kind: str = "Vector3") -> Message:
    """Return three or four numbers as ``geometry_msgs`` Vector3, Point or Quaternion."""
    return message(f"geometry_msgs/msg/{kind}", **dict(zip("xyzw", map(float, values), strict=False)))


class BagWriter:
    """Context manager that writes a ROS 2 bag, which appears under its name when it is complete.

    Args:
        path: folder to write; must be absent or empty.
        later: time added to all stamps, s.

    Raises:
        InputError: the folder is not empty, or cannot be written.
    """

    def __init__(self, path: Path, later: float = 0.0):
        self.path, self._later = path, round(1e9 * later)
        self._open = ExitStack()
        part = self._open.enter_context(new_folder(path, "bag"))
        self._writer = Writer(part, version=8)
        self._writer.open()
        self._open.callback(self._writer.close)
        self._connections: dict[str, Connection] = {}

    def __enter__(self) -> "BagWriter":
        return self

    def __exit__(self, *error: Any) -> None:
        self._open.__exit__(*error)

    def write(self, topic: str, time: float, content: Any) -> None:
        """Append a message, received at `time`, s; its stamps are shifted in place, so do not use it again."""
        kind = content.__msgtype__
        if topic not in self._connections:
            latched = (_LATCHED,) if topic == "/tf_static" else ()
            self._connections[topic] = self._writer.add_connection(
                topic, kind, typestore=_TYPES, offered_qos_profiles=latched
            )
        for each in getattr(content, "transforms", [content]) if self._later else ():
            stamp, frame = each.header.stamp, each.header.frame_id  # messages may share a header: each gets its own
            each.header = header(0.0, frame)
            seconds, nanoseconds = divmod(stamp.sec * 10**9 + stamp.nanosec + self._later, 10**9)
            each.header.stamp = message("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
        received = round(1e9 * time) + self._later
        self._writer.write(self._connections[topic], received, _TYPES.serialize_cdr(content, kind))
