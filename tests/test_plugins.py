"""A mechanism, a sensor, a shape, a mover and a board of another package: each is one file there, and works here."""

from importlib.metadata import EntryPoint

import numpy as np
import pytest

from radarize.io.errors import InputError
from radarize.radar.config import RadarConfig
from radarize.radar.presets import PRESETS
from radarsim.motion.trajectory import Motion
from radarsim.propagation import finder
from radarsim.scenario import Scenario
from radarsim.sensors import suite
from radarsim.world import plugins
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"].model_copy(update={"loops": 4})
WALL = {"name": "wall", "shape": "rectangle", "size": [4, 3], "position": [3, 0, 0], "facing": [-1, 0, 0]}

RAIN = '''
"""Rain: drops that fill the beam, each an isotropic point scatterer with a place of its own in every frame."""

import numpy as np

from radarsim.propagation.finder import MECHANISMS
from radarsim.propagation.paths import Kind, Paths

CROSS_SECTION, DROPS = 1e-5, 40


def find(view):
    seen = view.observation
    frame = np.repeat(np.arange(seen.frames), DROPS)
    away = np.random.default_rng(0).uniform([0.5, -0.5, -0.5], [2, 0.5, 0.5], (len(frame), 3))
    place = seen.position[frame] + np.einsum("nij,nj->ni", seen.rotation[frame], away)
    size = seen.wavelength * np.sqrt(CROSS_SECTION) / (4 * np.pi) ** 1.5 * seen.peak_gain**2
    amplitude = size / np.sum(away**2, axis=1) + 0j
    return Paths.of(Kind.POINT, np.stack([place, place], axis=1), amplitude, frame=frame)


MECHANISMS.append(find)
'''

BAROMETER = '''
"""A barometer: the sensor's height."""

from radarize.io.recording import Stream
from radarsim.sensors.sensor import Sensor
from radarsim.sensors.suite import SENSORS


class Barometer(Sensor):
    streams = {"barometer/height": Stream((), "f8", "m", "height of the sensor")}

    def observe(self, frames):
        return {"barometer/height": self.scenario.motion.position(frames.middles)[:, 2]}


SENSORS["barometer"] = Barometer
'''

PYRAMID = '''
"""A pyramid with a square base."""

from typing import Literal

import numpy as np
import trimesh

from radarsim.world import shapes
from radarsim.world.description import Length, TurnedShape


class Pyramid(TurnedShape):
    shape: Literal["pyramid"]
    side: Length
    height: Length

    def mesh(self, folder) -> trimesh.Trimesh:
        h = self.side / 2
        corners = np.array([[-h, -h, 0], [h, -h, 0], [h, h, 0], [-h, h, 0], [0, 0, self.height]])
        faces = [[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
        return self._placed(shapes.mesh(corners, np.array(faces)))
'''

PENDULUM = '''
"""A ball that swings to and fro before the radar."""

from typing import Literal

import numpy as np

from radarsim.world.movers import Length, Mover, Part, Point


class Pendulum(Mover):
    kind: Literal["pendulum"] = "pendulum"
    cross_section: Length = 0.5
    center: Point
    swing: Length = 0.1
    period: Length = 1.0

    def parts(self):
        return [Part((0.1, 0.1, 0.001), True)]

    def poses(self, t):
        t = np.asarray(t, float)
        center = np.asarray(self.center) + self.swing * np.sin(2 * np.pi * t / self.period)[:, None] * [1, 0, 0]
        return np.tile(np.eye(3), (len(t), 1, 1, 1)), center[:, None]
'''


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Makes a package of one file, as pip would, and what it names known; afterwards everything is as it was."""

    def install(name: str, source: str) -> None:
        (tmp_path / f"{name}.py").write_text(source)
        monkeypatch.syspath_prepend(tmp_path)
        points = [EntryPoint(name, name, plugins.GROUP)]
        monkeypatch.setattr(plugins, "entry_points", lambda group: points if group == plugins.GROUP else [])
        plugins.load.cache_clear()

    monkeypatch.setattr(finder, "MECHANISMS", list(finder.MECHANISMS))
    monkeypatch.setattr(suite, "SENSORS", dict(suite.SENSORS))
    yield install
    plugins.load.cache_clear()


def scenario(description: dict, *sensors: str, config: RadarConfig = CONFIG) -> Scenario:
    return Scenario(Scene.of(description, "place"), Motion.still((0, 0, 0)), config, sensors=sensors)


def test_a_mechanism(installed):
    room = {"objects": [WALL | {"material": "metal"}]}
    (dry,) = scenario(room).frames(np.zeros(1)).paths
    installed("rain", RAIN)
    (wet,) = scenario(room).frames(np.zeros(1)).paths
    assert len(wet) == len(dry) + 40
    assert np.ptp(wet.points[-40:, 0, 0]) > 1 and np.abs(wet.amplitude[-40:]).min() > 0


def test_a_sensor(installed):
    installed("barometer", BAROMETER)
    room = scenario({"objects": [WALL | {"material": "metal"}]}, "barometer")
    assert suite.Suite(room).observe(room.frames(np.zeros(1)))["barometer/height"].tolist() == [0.0]


def test_a_shape(installed):
    installed("pyramid", PYRAMID)
    item = {"name": "tip", "shape": "pyramid", "side": 0.4, "height": 0.3, "position": [2, 0, 0], "material": "metal"}
    scene = Scene.of({"objects": [item]}, "pyramid")
    assert scene.objects[0].mesh.volume == pytest.approx(0.4 * 0.4 * 0.3 / 3)
    with pytest.raises(InputError, match="objects\\[0\\].side.* is -1"):
        Scene.of({"objects": [item | {"side": -1}]}, "pyramid")
    with pytest.raises(InputError, match="is 'cone', expected one of: .*'?box'?.*pyramid"):
        Scene.of({"objects": [item | {"shape": "cone"}]}, "pyramid")


def test_a_mover(installed):
    """A quarter of a period after its middle it stands still, at its middle it closes at 2 pi swing / period."""
    installed("pendulum", PENDULUM)
    ball = {"kind": "pendulum", "name": "ball", "center": [2, 0, 0], "swing": 0.1, "period": 1.0}
    room = scenario({"objects": [WALL | {"material": "metal"}], "moving": [ball]})
    for start, speed in ((0.25, 0.0), (0.0, -0.2 * np.pi)):
        frames = room.frames(np.array([start - CONFIG.burst_center]))
        (paths,), (lengths,) = frames.paths, frames.lengths
        rows = paths.moving & (paths.bounces == 0)
        half = (CONFIG.chirp_times.max() - CONFIG.chirp_times.min()) / 2
        assert rows.any()
        assert -lengths[rows, 0, 1].mean() / half / 2 == pytest.approx(speed, abs=0.02)


def test_a_mover_without_a_cross_section(installed):
    """It hides the wall behind it, whose specular echo the radar gets on its axis, and does not echo itself."""
    installed("curtain", PENDULUM.replace("    cross_section: Length = 0.5\n", "").replace("pendulum", "curtain"))
    ball = {"kind": "curtain", "name": "ball", "center": [2, 0, 0], "swing": 0.001}
    wall = {"objects": [WALL | {"material": "metal"}]}
    (free,), (hidden,) = (scenario(wall | some).frames(np.zeros(1)).paths for some in ({}, {"moving": [ball]}))
    assert not hidden.moving.any()
    strongest = [20 * np.log10(np.abs(paths.amplitude).max()) for paths in (free, hidden)]
    assert strongest[1] < strongest[0] - 20


def test_what_cannot_be_imported_is_named(installed):
    installed("broken", "import nothing_of_this_name")
    with pytest.raises(InputError, match="plug-in broken .*nothing_of_this_name"):
        Scene.of({"objects": [WALL | {"material": "metal"}]}, "place")
