"""The ROS 2 node's messages, through the wire format, against the pipeline's own results."""

import importlib.util
import threading
from pathlib import Path

import numpy as np
import pytest

from radarize.io.pose import compose
from radarize.io.recording import RecordingWriter
from radarize.pipeline.methods import CLASSICAL
from radarize.pipeline.runfolder import OccupancyMap
from radarize.pipeline.runfolder.occupancy import MapFile
from radarize.radar.presets import PRESETS
from tests.examples import ros

NODE = Path(__file__).parents[2] / "examples" / "ros2" / "radarize_node.py"
FRAMES = 12


@pytest.fixture(scope="module")
def module():
    with pytest.MonkeyPatch.context() as patch:
        ros.install(patch)
        specification = importlib.util.spec_from_file_location("radarize_node", NODE)
        found = importlib.util.module_from_spec(specification)
        specification.loader.exec_module(found)
        yield found


def pose(place, turn) -> np.ndarray:
    return np.array([place.x, place.y, 2 * np.arctan2(turn.z, turn.w)])


def test_a_recording_is_followed(module, tmp_path, monkeypatch):
    config = PRESETS["radarize"].model_copy(update={"loops": 4})
    with RecordingWriter(tmp_path / "walk.h5", config) as writer:
        noise = np.random.default_rng(0).integers(-99, 99, (FRAMES, *config.frame_shape), dtype=np.int16)
        writer.append(noise, 100 + np.arange(FRAMES) * config.frame_period)
    monkeypatch.setattr(ros.Node, "parameters", {"replay": tmp_path / "walk.h5", **CLASSICAL})
    node = module.RadarizeNode()
    results, push = [], node.pipeline.push
    node.pipeline.push = lambda batch: results.append(push(batch)) or results[-1]
    node.run(threading.Event())
    assert set(node.published) == {"scan", "odom", "/tf", "map"}
    ranges = np.concatenate([result.ranges for result in results])
    assert len(node.published["scan"]) == len(ranges) > 0
    for scan, expected in zip(node.published["scan"], ranges, strict=True):
        assert scan.header.frame_id == "radar" and np.array_equal(scan.ranges, expected.astype(np.float32))
        assert len(scan.ranges) == 1 + round((scan.angle_max - scan.angle_min) / scan.angle_increment)
        assert scan.header.stamp.sec == 100
    last, links = results[-1].track, {link.child_frame_id: link for link in node.published["/tf"][-1].transforms}
    odometry = node.published["odom"][-1]
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
    assert pose(odometry.pose.pose.position, odometry.pose.pose.orientation) == pytest.approx(last.pose[-1])
    steps = {child: pose(link.transform.translation, link.transform.rotation) for child, link in links.items()}
    assert [link.header.frame_id for link in links.values()] == ["map", "odom"] and set(steps) == {"odom", "base_link"}
    assert compose(steps["odom"], steps["base_link"])[:2] == pytest.approx(last.pose[-1][:2], abs=0.5)
    spread = odometry.pose.covariance.reshape(6, 6)
    assert np.linalg.eigvalsh(spread).min() > -1e-12 and (spread[[2, 3, 4]] == 0).all()
    first = np.trace(node.published["odom"][0].pose.covariance.reshape(6, 6))
    assert np.trace(spread) > first  # what odometry leaves unknown adds up


def test_a_map_begins_at_its_smallest_corner(module):
    pixels = np.full((2, 3), 205, np.uint8)
    pixels[0, 2], pixels[1, 0] = 0, 254
    chart = OccupancyMap(MapFile(image="map.pgm", resolution=0.05, origin=(-1.0, 2.0, 0.0)), pixels)
    found = ros.sent(module.map_message(3.5, chart))
    assert (found.info.width, found.info.height, round(found.info.resolution, 6)) == (3, 2, 0.05)
    assert found.data.tolist() == [0, -1, -1, -1, -1, 100]
    assert pose(found.info.origin.position, found.info.origin.orientation) == pytest.approx([-1, 2, 0])
    assert (found.header.stamp.sec, found.header.stamp.nanosec) == (3, 500_000_000)


def test_covariances_are_on_the_axes_of_odom(module):
    """Uncertainty ahead, while facing left, is uncertainty along y."""
    message = ros.sent(module.odometry_message(0.0, np.array([0, 0, np.pi / 2]), np.zeros(2), np.diag([4.0, 1.0, 0.1])))
    spread = message.pose.covariance.reshape(6, 6)
    assert np.diag(spread) == pytest.approx([1, 4, 0, 0, 0, 0.1])


def test_the_launch_file_is_python_and_names_the_node():
    text = NODE.with_name("radarize.launch.py").read_text()
    compile(text, "radarize.launch.py", "exec")
    parameters = NODE.read_text().split("for name in (")[1].split(")")[0]
    assert f"PARAMETERS = ({parameters})" in text
