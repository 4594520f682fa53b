"""What Foxglove is sent, by a client of its own protocol and by the file, against what was given."""

import base64
import json
import struct
import threading
from collections.abc import Iterator

import numpy as np
import pytest
from backports import zstd
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from websockets.sync.client import connect

from radarize.cli import app
from radarize.io.console import run
from radarize.io.errors import InputError
from radarize.io.pose import compose
from radarize.io.recording import Product, RecordingWriter, Stream
from radarize.pipeline.runfolder import OccupancyMap, RunFolder
from radarize.pipeline.runfolder.occupancy import MapFile
from radarize.radar.presets import PRESETS
from tests.evaluation.fake_run import write_run

Server = pytest.importorskip("radarize.evaluation.foxglove", reason="pip install 'radarize[viewer]'").Server
write_mcap = pytest.importorskip("radarize.evaluation.mcap").write_mcap

SLAM, ODOMETRY = np.array([2.0, 1.0, 0.5]), np.array([1.8, 1.3, 0.3])


class Client:
    """Subscribes to all that is advertised (Foxglove's WebSocket protocol) and decodes it by the schemas beside it."""

    def __init__(self, url: str):
        self._socket = connect(url, subprotocols=["foxglove.sdk.v1"], max_size=None)
        self.topics: dict[int, str] = {}
        self._kinds: dict[int, type] = {}

    def receive(self) -> tuple[str, int, object]:
        """Topic, stamp in ns, and the next message."""
        while True:
            got = self._socket.recv(timeout=10)
            if isinstance(got, str):
                self._hear(json.loads(got))
            elif got[0] == 1:
                which, stamp = struct.unpack_from("<IQ", got, 1)
                return self.topics[which], stamp, self._kinds[which].FromString(got[13:])

    def _hear(self, message: dict) -> None:
        if message["op"] != "advertise":
            return
        for channel in message["channels"]:
            self.topics[channel["id"]] = channel["topic"]
            self._kinds[channel["id"]] = decoder(base64.b64decode(channel["schema"]), channel["schemaName"])
        wanted = [{"id": channel["id"], "channelId": channel["id"]} for channel in message["channels"]]
        self._socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))


def decoder(schema: bytes, name: str) -> type:
    pool = descriptor_pool.DescriptorPool()
    left = list(descriptor_pb2.FileDescriptorSet.FromString(schema).file)
    while left:  # those first that others need
        known = {file.name for file in left}
        ready = next(file for file in left if not known & set(file.dependency))
        pool.Add(ready)
        left.remove(ready)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(name))


def planar(pose) -> np.ndarray:
    place, turn = (pose.position, pose.orientation) if hasattr(pose, "position") else (pose.translation, pose.rotation)
    assert place.z == turn.x == turn.y == 0
    return np.array([place.x, place.y, 2 * np.arctan2(turn.z, turn.w)])


def newest(server: Server, send) -> dict[str, tuple[int, object]]:
    """What a client gets that looks on while things are sent, by topic."""
    client, got = Client(server.url), {}
    stop = threading.Event()

    def keep_sending() -> None:  # what is sent before the client has subscribed is lost, as a radar's frames are
        while not stop.wait(0.02):
            send()

    thread = threading.Thread(target=keep_sending)
    thread.start()
    try:
        while len(got) < 5:
            topic, stamp, content = client.receive()
            got[topic] = stamp, content
    finally:
        stop.set()
        thread.join()
    return got


@pytest.fixture
def chart() -> OccupancyMap:
    pixels = np.full((3, 4), 205, np.uint8)
    pixels[0, 1], pixels[2, 3] = 0, 254  # a wall in the row of largest y, and free ground
    return OccupancyMap(MapFile(image="map.pgm", resolution=0.05, origin=(-1.0, 2.0, 0.0)), pixels)


def test_a_client_gets_frames_scan_path_map_and_pictures(chart):
    ranges = np.where(np.arange(88) % 2, np.inf, 1.5)
    picture = np.arange(2 * 3 * 4, dtype=np.uint8).reshape(2, 3, 4)
    with Server("127.0.0.1:0") as server:

        def send() -> None:
            server.pose(12.25, SLAM, ODOMETRY)
            server.scan(12.25, ranges)
            server.path(12.25, np.array([SLAM, ODOMETRY]))
            server.map(12.25, chart)
            server.picture(12.25, "fan", picture)

        got = newest(server, send)
    assert {stamp for stamp, _ in got.values()} == {12_250_000_000}
    links = {(link.parent_frame_id, link.child_frame_id): planar(link) for link in got["/tf"][1].transforms}
    assert list(links) == [("map", "odom"), ("odom", "base_link"), ("base_link", "radar")]
    found = compose(links["map", "odom"], links["odom", "base_link"])
    assert found == pytest.approx(SLAM) and links["odom", "base_link"] == pytest.approx(ODOMETRY)
    assert np.array_equal(links["base_link", "radar"], np.zeros(3))
    scan = got["/scan"][1]
    assert scan.frame_id == "radar" and list(scan.ranges) == ranges.tolist()
    assert np.degrees([scan.start_angle, scan.end_angle]) == pytest.approx([-44, 43])
    assert [planar(pose) for pose in got["/path"][1].poses] == [pytest.approx(SLAM), pytest.approx(ODOMETRY)]
    grid = got["/map"][1]
    assert grid.frame_id == got["/path"][1].frame_id == "map" and planar(grid.pose) == pytest.approx([-1, 2, 0])
    cells = np.frombuffer(grid.data, np.int8).reshape(-1, grid.column_count)
    assert cells.tolist() == [[-1, -1, -1, 0], [-1, -1, -1, -1], [-1, 100, -1, -1]]  # smallest y first
    assert (grid.cell_size.x, grid.row_stride, grid.cell_stride) == (0.05, 4, 1)
    image = got["/radar/fan"][1]
    assert (image.width, image.height, image.encoding, image.step) == (3, 2, "rgba8", 12)
    assert image.data == picture.tobytes()


def test_addresses_that_are_taken_or_none():
    with Server("127.0.0.1:0") as server:
        for address in (server.url.removeprefix("ws://"), "127.0.0.1", "127.0.0.1:99999"):
            with pytest.raises(InputError, match=f"--foxglove {address}: .*expected HOST:PORT"):
                Server(address)


def messages(content: bytes) -> Iterator[tuple[str, int, object]]:
    """Topic, stamp in ns and decoded content of an MCAP file's messages (mcap.dev/spec)."""
    kinds, channels, records = {}, {}, [content[8:-8]]
    while records:
        data, at = records.pop(), 0
        while at < len(data):
            kind, length = struct.unpack_from("<BQ", data, at)
            body, at = data[at + 9 : at + 9 + length], at + 9 + length
            if kind == 3:  # schema
                name, rest = text(body, 2)
                kinds[body[:2]] = decoder(body[text(body, rest)[1] + 4 :], name)
            elif kind == 4:
                channels[body[:2]] = text(body, 4)[0], kinds[body[2:4]]
            elif kind == 5:
                topic, decode = channels[body[:2]]
                yield topic, struct.unpack_from("<Q", body, 6)[0], decode.FromString(body[22:])
            elif kind == 6:  # chunk of records
                packing, end = text(body, 28)
                records += [data[at:], zstd.decompress(body[end + 8 :]) if packing == "zstd" else body[end + 8 :]]
                break


def text(data: bytes, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", data, at)
    return data[at + 4 : at + 4 + length].decode(), at + 4 + length


def test_a_recording_and_its_run_become_a_file(tmp_path, capsys):
    config = PRESETS["radarize"].model_copy(update={"loops": 4})
    with RecordingWriter(tmp_path / "walk.h5", config) as writer:
        noise = np.random.default_rng(0).integers(-99, 99, (20, *config.frame_shape), dtype=np.int16)
        writer.append(noise, np.arange(20) * config.frame_period)
    folder = RunFolder(write_run(tmp_path / "run"))
    words = ["view", tmp_path / "walk.h5", "--run", folder.path, "--save", tmp_path / "walk.mcap"]
    with pytest.raises(SystemExit) as ended:
        run(app, "radarize", [str(word) for word in words])
    assert ended.value.code == 0, capsys.readouterr().err
    found: dict[str, list] = {}
    for topic, stamp, content in messages((tmp_path / "walk.mcap").read_bytes()):
        found.setdefault(topic, []).append((stamp / 1e9, content))
    times, poses = folder.trajectory
    assert [stamp for stamp, _ in found["/tf"]] == pytest.approx(times, abs=1e-6)
    links = [{link.child_frame_id: planar(link) for link in content.transforms} for _, content in found["/tf"]]
    shown = np.array([compose(link["odom"], link["base_link"]) for link in links])
    assert shown[:, :2] == pytest.approx(poses[:, :2], abs=1e-6)
    moved = np.array([link["base_link"] for link in links])
    assert moved[:, :2] == pytest.approx(folder.odometry[1][:, :2], abs=1e-6)
    assert len(found["/scan"]) == len(folder.scans["time"])
    assert np.array_equal(np.array(found["/scan"][7][1].ranges), folder.scans["ranges"][7])
    cells = np.frombuffer(found["/map"][0][1].data, np.int8).reshape(folder.map.pixels.shape)[::-1]
    assert np.array_equal(cells == 100, folder.map.occupied)
    for name in ("range_azimuth", "doppler_azimuth"):
        assert len(found[f"/radar/{name}"]) == 20 and found[f"/radar/{name}"][0][1].encoding == "rgb8"


def test_truth_depth_path_types_and_points_are_in_the_file(tmp_path):
    """A recording alone: the world moves about the radar, which is where the truth is."""
    config, count = PRESETS["radarize"].model_copy(update={"loops": 4}), 3
    times = np.arange(count) * config.frame_period
    poses = np.column_stack([times, 0 * times, 1 + 0 * times, 0 * times, 0 * times, np.sin(times), np.cos(times)])
    depth = np.arange(count * 6 * 8, dtype=np.uint16).reshape(count, 6, 8)
    cause = np.full((count, 96, 80), 255, np.uint8)
    cause[:, -1, -1] = 2
    cloud = np.array([[1, 2, 3, 0.5, 12, 1], [4, 5, 6, -0.5, 11, 1]])
    rows = {
        "truth/time": times + config.burst_center, "truth/pose": poses, "truth/depth": depth, "truth/cause": cause,
        "points/frame": np.array([0, 2]), "points/cloud": cloud,
    }  # fmt: skip
    streams = {name: Stream(data.shape[1:], data.dtype.str, "", "") for name, data in rows.items()}
    streams["points/frame"] = Stream((), "i4", "", "", "points/frame")
    streams["points/cloud"] = Stream((6,), "f4", "m", "", "points/frame")
    mount = np.array([0.0, 0.1, 0, 0, 0, 0, 1])
    products = {
        "truth/depth_mount": Product(mount, "m", ""),
        "truth/depth_intrinsics": Product(np.array([5.0, 6.0, 3.5, 2.5]), "pixels", ""),
    }
    with RecordingWriter(tmp_path / "walk.h5", config, streams=streams, products=products) as writer:
        writer.append(np.ones((count, *config.frame_shape), np.int16), times, rows=rows)
    write_mcap(tmp_path / "walk.h5", None, tmp_path / "walk.mcap")
    found: dict[str, list] = {}
    for topic, _, content in messages((tmp_path / "walk.mcap").read_bytes()):
        found.setdefault(topic, []).append(content)
    links = [link for content in found["/tf"] for link in content.transforms]
    parents = {link.child_frame_id: link.parent_frame_id for link in links}
    assert parents == {
        "truth": "world", "world": "base_link", "radar": "base_link", "camera_depth_frame": "base_link",
        "camera_depth_optical_frame": "camera_depth_frame",
    }  # fmt: skip
    true = [link.translation for link in links if link.child_frame_id == "truth"]
    assert np.array([(p.x, p.z) for p in true]) == pytest.approx(np.column_stack([times, np.ones(count)]))
    assert len(found["/truth/path"][0].poses) == count
    picture = found["/camera/depth/image_rect_raw"][1]
    assert picture.encoding == "16UC1" and np.array_equal(np.frombuffer(picture.data, "<u2"), depth[1].ravel())
    assert list(found["/camera/depth/camera_info"][0].K)[:3] == [5, 0, 3.5]
    shown = np.frombuffer(found["/radar/cause"][0].data, np.uint8).reshape(96, 80, 3)
    assert shown[0, 0].any() and not shown[1:].any()  # far is up, left is left
    clouds = [np.frombuffer(content.data, "<f4").reshape(-1, 6) for content in found["/radar/points"]]
    assert [len(points) for points in clouds] == [1, 0, 1] and clouds[2][0] == pytest.approx(cloud[1])
    assert [field.name for field in found["/radar/points"][0].fields][:4] == ["x", "y", "z", "velocity"]
