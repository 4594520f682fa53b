"""The page of a scene in a browser: it draws building, tour and rays, and complains of nothing."""

import numpy as np
import pytest

from radarize.radar.presets import PRESETS
from radarsim.motion.walk import Walk
from radarsim.scenario import Scenario
from radarsim.webpreview import web_preview
from radarsim.world.preview.rendering import cut_open
from radarsim.world.scene import Scene
from tests.capture.browser import CHROMIUM, Browser

WALK = Walk(duration=2.0)
DATA = "document.getElementById('plot-1')._fullData.filter(trace => trace.{}).map(trace => trace.{})"


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed (apt-get install chromium)")
def test_it_shows_building_tour_and_echoes(tmp_path):
    scene = Scene.load("physics/room")
    motion = WALK.through(scene, 0)
    scenario = Scenario(scene, motion, PRESETS["radarize"], seed=0)
    frame = scenario.frames(np.array([1.0]))
    types = set(frame.types[0].tolist())
    page = web_preview(scene, tmp_path / "room.html", WALK, time=1.0)
    with Browser(page.as_uri(), tmp_path / "profile") as browser:
        browser.wait("document.querySelectorAll('.js-plotly-plot').length === 1")
        assert browser.evaluate("document.querySelector('h1').textContent") == scene.name
        names = browser.evaluate(DATA.format("type === 'scatter3d'", "name"))
        assert names[:2] == ["tour", "direct"] and len(names) == 1 + len(types)
        corners = browser.evaluate(DATA.format("type === 'mesh3d'", "x.length"))
        assert corners == [len(item.mesh.vertices) for item in cut_open(scene)]
        (place,) = browser.evaluate(DATA.format("name === 'direct'", "x[0]"))
        assert place == pytest.approx(motion.position(frame.middles)[0, 0], abs=1e-3)
        assert browser.errors == []
