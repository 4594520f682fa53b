"""A stand-in for ROS 2's Python: message classes by rosbags' definitions, and as much of rclpy as the node calls."""

import sys
from functools import cache
from types import ModuleType, SimpleNamespace

import numpy as np
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
#: Packages whose messages the node may import.
PACKAGES = ("builtin_interfaces", "geometry_msgs", "nav_msgs", "sensor_msgs", "tf2_msgs")


@cache
def message_class(kind: str) -> type:
    """A message class as in rclpy: constructed with any fields, the others zero; unknown fields raise."""
    definition = dict(STORE.fielddefs[kind][1])

    class Message:
        def __init__(self, **given):
            for name, of in definition.items():
                setattr(self, name, given.pop(name) if name in given else _blank(of))
            assert not given, f"{kind} has no {given}"

        def __setattr__(self, name, content):
            assert name in definition, f"{kind} has no {name}"
            super().__setattr__(name, content)

        def whole(self) -> object:
            """As rosbags writes it."""
            return STORE.types[kind](**{name: _filled(getattr(self, name), of) for name, of in definition.items()})

    return Message


def _blank(of: tuple) -> object:
    node, detail = of
    if node.name == "NAME":
        return message_class(detail)()
    if node.name == "BASE":
        return {"string": "", "bool": False}.get(detail[0], 0.0 if "float" in detail[0] else 0)
    return [_blank(detail[0]) for _ in range(detail[1])] if node.name == "ARRAY" else []


def _filled(content: object, of: tuple) -> object:
    node, detail = of
    if node.name == "NAME":
        return content.whole()
    if node.name == "BASE":
        return content
    inner, what = detail[0]
    return np.array(content, what[0]) if inner.name == "BASE" else [each.whole() for each in content]


def sent(message) -> object:
    """A received message: the sent one through the wire format and back, which refuses wrong types and lengths."""
    whole = message.whole()
    return STORE.deserialize_cdr(STORE.serialize_cdr(whole, whole.__msgtype__), whole.__msgtype__)


class Node:
    """Stores published messages by topic."""

    parameters: dict[str, str] = {}

    def __init__(self, name: str):
        self.published: dict[str, list] = {}

    def declare_parameter(self, name: str, default: str):
        return SimpleNamespace(value=self.parameters.get(name, default))

    def create_publisher(self, kind: type, topic: str, qos: object):
        kept = self.published.setdefault(topic, [])
        return SimpleNamespace(publish=lambda message: kept.append(sent(message)))


class Time:
    """Nanoseconds, as a message on demand."""

    def __init__(self, nanoseconds: int):
        self._nanoseconds = nanoseconds

    def to_msg(self) -> object:
        seconds, rest = divmod(self._nanoseconds, 10**9)
        return message_class("builtin_interfaces/msg/Time")(sec=seconds, nanosec=rest)


def install(patch) -> None:
    """Install the stand-in under the names that the node imports."""
    modules = {
        "rclpy": {"ok": lambda: True},
        "rclpy.node": {"Node": Node},
        "rclpy.qos": {
            "DurabilityPolicy": SimpleNamespace(TRANSIENT_LOCAL="transient local"), "QoSProfile": SimpleNamespace,
        },
        "rclpy.time": {"Time": Time},
    }  # fmt: skip
    for package in PACKAGES:
        names = [kind for kind in STORE.types if kind.startswith(f"{package}/msg/")]
        modules |= {package: {}, f"{package}.msg": {kind.split("/")[2]: message_class(kind) for kind in names}}
    for name, content in modules.items():
        module = ModuleType(name)
        module.__dict__.update(content)
        patch.setitem(sys.modules, name, module)
