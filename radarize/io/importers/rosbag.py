"""ROS 1 and ROS 2 bags as streams of messages, through the `rosbags` library.

The radar's frames are decoded with the definition in the bag; if there is none, as in ROS 2 bags before Iron, with
ours. All other messages are standard ROS types.
"""

import heapq
import re
from collections.abc import Collection, Generator, Iterator
from contextlib import ExitStack
from io import BytesIO
from pathlib import Path
from reprlib import repr as shortened
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Float
from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag1.reader import Header, RecordType, read_bytes, read_uint32
from rosbags.rosbag2 import Reader as Reader2
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from radarize.io.errors import explained

#: Message that the Radarize data set's recorder publishes per frame, as defined in its package; header stamps are
#: unset. Phase biases are pairs of real and imaginary parts, chirp_time is in us, chirp_slope in Hz/s, frame_time in
#: ms, sample_rate in Hz, and the shape is chirps, receivers, samples.
FRAME_TYPE = "xwr_raw_ros/msg/RadarFrameFull"
FRAME_DEFINITION = """std_msgs/Header header
string platform
uint8 adc_output_fmt
float32 range_bias
float32[] rx_phase_bias
float32 chirp_time
float32 chirp_slope
float32 frame_time
float32 velocity_max
float32 velocity_res
float32 sample_rate
float32 range_max
float32 range_res
uint8[] rx
uint8[] tx
uint32[] shape
int16[] data
"""
#: A message from `rosbags`; its fields are those of a definition in the bag.
Message: TypeAlias = Any


class StreamingReader(Reader1):
    """Reader of a ROS 1 bag, chunk by chunk in order of time; the library's reader keeps an entry for every message."""

    def read_index_data(self, pos: int, indexes: dict) -> None:
        """Skip the index of messages."""

    def messages(
        self, connections: Collection[Connection] = (), start: int | None = None, stop: int | None = None
    ) -> Generator[tuple[Connection, int, bytes], None, None]:
        """Yield connection, time of receipt (ns) and content of messages, by ascending time."""
        del start, stop  # bags are read whole
        wanted = {connection.id: connection for connection in connections or self.connections}
        infos = [info for info in self.chunk_infos if wanted.keys() & info.connection_counts.keys()]
        infos.sort(key=lambda info: info.start_time)
        waiting: list[tuple[int, int, int, bytes]] = []  # of chunks that overlap in time
        order = 0
        for number, info in enumerate(infos):
            for time, connection, data in self._chunk_messages(info.pos, wanted):
                heapq.heappush(waiting, (time, order := order + 1, connection, data))
            until = infos[number + 1].start_time if number + 1 < len(infos) else 2**63
            while waiting and waiting[0][0] < until:
                time, _, connection, data = heapq.heappop(waiting)
                yield wanted[connection], time, data

    def _chunk_messages(self, position: int, wanted: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        assert self.bio is not None  # as long as the bag is open
        chunk = self.chunks[position]
        self.bio.seek(chunk.datapos)
        content = chunk.decompressor(read_bytes(self.bio, chunk.datasize))
        records = BytesIO(content)
        while records.tell() < len(content):
            header = Header.read(records)
            data = read_bytes(records, read_uint32(records))
            if header.get_uint8("op") == RecordType.MSGDATA and (connection := header.get_uint32("conn")) in wanted:
                yield header.get_time("time"), connection, data

    def count(self, connection: Connection) -> int:
        """Return the number of messages on a connection."""
        return sum(info.connection_counts.get(connection.id, 0) for info in self.chunk_infos)


class Bag:
    """A bag opened for reading; use as a context manager.

    Args:
        path: a ROS 1 ``.bag``, the folder of a ROS 2 bag, or its ``.mcap`` or ``.db3``.

    Raises:
        InputError: not a bag, or an unfinished or damaged one.
    """

    def __init__(self, path: Path):
        self.path = path
        self._ros1 = path.suffix.lower() == ".bag"
        with ExitStack() as stack:
            with explained(f"{path}: is no readable ROS bag"):
                self._reader = StreamingReader(path) if self._ros1 else Reader2(path)
                self._reader.open()
                for connection in self._reader.connections:  # SQLite's columns hold values of any type
                    if not isinstance(connection.topic, str) or not isinstance(connection.msgtype, str):
                        raise ValueError(f"a topic is named {shortened(connection.topic)}, expected text")
            stack.callback(self._reader.close)
            with explained(f"{path}: has message definitions that cannot be read"):
                self._types = self._definitions()
            self._open = stack.pop_all()

    def __enter__(self) -> "Bag":
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def _definitions(self) -> Typestore:
        """Return definitions of standard messages, and of the radar's frames from the bag."""
        types = get_typestore(Stores.ROS1_NOETIC if self._ros1 else Stores.ROS2_HUMBLE)
        found = get_types_from_msg(FRAME_DEFINITION, FRAME_TYPE)
        for connection in self._reader.connections:
            definition = connection.msgdef
            if is_frame(connection.msgtype) and definition.format == MessageDefinitionFormat.MSG:
                found |= get_types_from_msg(definition.data, connection.msgtype)
            elif is_frame(connection.msgtype) and definition.format == MessageDefinitionFormat.IDL:
                found |= get_types_from_idl(definition.data)
        types.register({name: fields for name, fields in found.items() if name not in types.fielddefs})
        return types

    @property
    def topics(self) -> dict[str, tuple[str, int]]:
        """Type (``package/msg/Name``) and number of messages, by topic."""
        return {
            connection.topic: (
                connection.msgtype,
                self._reader.count(connection) if isinstance(self._reader, StreamingReader) else connection.msgcount,
            )
            for connection in self._reader.connections
        }

    def messages(self, topics: Collection[str]) -> Iterator[tuple[str, int, Message]]:
        """Yield topic, time of receipt (ns) and content of messages, by ascending time.

        Raises:
            InputError: the bag is damaged, or a message does not match its definition.
        """
        decode = self._types.deserialize_ros1 if self._ros1 else self._types.deserialize_cdr
        with explained(f"{self.path}: is no readable ROS bag"):
            for connection, time, data in self._packed(topics):
                yield connection.topic, time, decode(data, connection.msgtype)

    def receipts(self, topic: str) -> Float[np.ndarray, "message"]:
        """Return times of receipt of a topic's messages, s, without decoding them.

        Raises:
            InputError: the bag is damaged.
        """
        with explained(f"{self.path}: is no readable ROS bag"):
            return np.array([1e-9 * time for _, time, _ in self._packed([topic])])

    def _packed(self, topics: Collection[str]) -> Iterator[tuple]:
        connections = [connection for connection in self._reader.connections if connection.topic in topics]
        for connection, time, data in self._reader.messages(connections=connections):
            if not isinstance(time, int):
                raise ValueError(f"a message on {connection.topic} has no number for its time, {shortened(time)}")
            yield connection, time, data


def is_frame(kind: str) -> bool:
    """Return whether a message type is that of raw radar frames, of any package."""
    return bool(re.fullmatch(r"[A-Za-z]\w*/msg/RadarFrameFull", kind, re.ASCII))
