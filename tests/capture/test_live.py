"""Live pipeline on a stream: the same result as from the file, shown in a real browser."""

import json
import threading
import time
import urllib.request

import numpy as np
import pytest
from typer.testing import CliRunner

from radarize.capture.live import Live, prepare
from radarize.capture.page import LivePage
from radarize.capture.record import Keeper
from radarize.capture.replay import Replay
from radarize.cli import app
from radarize.io.errors import InputError
from radarize.io.recording import Recording, RecordingWriter
from radarize.pipeline.method import Inputs
from radarize.pipeline.methods import CLASSICAL, make_pipeline
from radarize.pipeline.pipeline import Result
from radarize.radar.cfg import write_cfg
from radarize.radar.presets import PRESETS
from radarize.signal.batch import Preprocessor
from radarize.signal.bearings import BEARINGS
from radarize.slam.node import Node, Scan
from radarize.slam.rendering import MapRenderer
from tests import virtual
from tests.capture.browser import CHROMIUM, Browser
from tests.virtual import SMALL, emulated

FRAMES = 60


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """Echoes on every side that close as the sensor moves ahead; the last frame but one is lost."""
    config, rng = PRESETS["radarize"], np.random.default_rng(0)
    bins, azimuths = rng.uniform(12, 80, 12), rng.uniform(-0.7, 0.7, 12)
    antenna = np.arange(3)[:, None] * 4 + np.arange(4)
    slot = np.arange(config.loops)[:, None] * 3 + np.array(config.slot)
    adc = np.zeros((FRAMES, *config.frame_shape))
    for k in range(FRAMES):
        time = k * config.frame_period + slot * config.chirp_time
        signal = np.zeros(config.frame_shape[:-1], complex)
        for at, azimuth in zip(bins, azimuths, strict=True):
            doppler = np.exp(-4j * np.pi / config.wavelength * 0.5 * np.cos(azimuth) * time)
            angle = np.exp(-1j * np.pi * antenna * np.sin(azimuth))
            beat = np.exp(2j * np.pi * at * np.arange(config.samples) / config.samples)
            signal += 200 * doppler[:, :, None, None] * angle[:, :, None] * beat
        adc[k] = np.stack([signal.real, signal.imag], axis=-1)
    adc = np.rint(adc + rng.normal(0, 10, adc.shape)).astype(np.int16)
    valid = np.ones(adc.shape[:3], bool)
    valid[FRAMES - 2], adc[FRAMES - 2] = False, 0
    path = tmp_path_factory.mktemp("walk") / "walk.h5"
    with RecordingWriter(path, config) as writer:
        writer.append(adc, np.arange(FRAMES) * config.frame_period, valid)
    return path


class Kept(Live):
    """Live pipeline that stores its results."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.results: list[Result] = []
        shown = self.view.add
        self.view.add = lambda result: (self.results.append(result), shown(result))


def poses(results: list[Result]) -> np.ndarray:
    return np.concatenate([result.track.pose for result in results])


@pytest.mark.parametrize("every", [1, 2])
def test_a_replay_gives_what_the_file_gives(walk, tmp_path, every):
    """For every frame, or every second one; all are recorded."""
    inputs = Inputs(PRESETS["radarize"], every=every)
    with LivePage("127.0.0.1:0") as page, Replay(walk, speed=2.0, slots=FRAMES) as stream:
        live = Kept(inputs, CLASSICAL, page)
        with RecordingWriter(tmp_path / "again.h5", stream.config) as writer:
            list(live.follow(stream, threading.Event(), keeper=Keeper(writer)))
    assert live.pipeline.seconds["page"] > 0
    offline, preprocessor = make_pipeline(inputs, **CLASSICAL), Preprocessor(inputs.signal, every)
    with Recording(walk) as one, Recording(tmp_path / "again.h5") as other:
        # In the live view's own batches: on some processors sums are ordered otherwise in batches of another size.
        ends = [*(each.frames[-1] + 1 for each in live.results[:-1]), FRAMES]
        spans = zip([0, *ends[:-1]], ends, strict=True)
        results = [offline.push(preprocessor.process(one.adc(a, b), one.times[a:b], one.valid(a, b))) for a, b in spans]
        assert np.array_equal(one.adc(0, FRAMES), other.adc(0, FRAMES))
        assert np.array_equal(one.valid(0, FRAMES), other.valid(0, FRAMES)) and np.array_equal(one.times, other.times)
    assert poses(live.results) == pytest.approx(poses(results), abs=1e-6)
    frames = [np.concatenate([each.frames for each in some]) for some in (live.results, results)]
    wanted = [k for k in range(0, FRAMES, every) if k != FRAMES - 2]
    assert frames[0].tolist() == frames[1].tolist() == wanted and live.preprocessor.lost == preprocessor.lost == 1
    assert live.losses.lost_frames == 1 and live.preprocessor.taken == FRAMES // every and stream.counts.dropped == 0


def test_foxglove_gets_what_the_page_gets(walk):
    """Same content as on the page; the protocol is tested in tests/evaluation/test_foxglove.py."""
    sent = []

    class Server:
        def __getattr__(self, name):
            return lambda *given: sent.append((name, *given))

    with LivePage("127.0.0.1:0") as page, Replay(walk, speed=2.0, slots=FRAMES) as stream:
        live = Kept(Inputs(PRESETS["radarize"]), CLASSICAL, page, Server())
        places, place = [], live.view.pose
        live.view.pose = lambda: places.append(place()) or places[-1]
        list(live.follow(stream, threading.Event()))
    assert {name for name, *_ in sent} == {"pose", "scan", "picture", "map", "path"}
    _, slam, odometry = next(given for name, *given in reversed(sent) if name == "pose")
    assert abs(poses(live.results) - odometry).max(axis=1).min() < 1e-9
    assert any(np.array_equal(slam, each) for each in places)
    assert sent[-1][0] == "path" and np.array_equal(sent[-1][2], live.pipeline.slam.graph.poses)


def test_too_slow_means_dropped_frames_not_delay(walk):
    """Ten times real time, and space for four frames: processed frames are whole, dropped ones are counted."""
    with LivePage("127.0.0.1:0") as page, Replay(walk, speed=1e4, slots=4) as stream:
        live = Live(Inputs(PRESETS["radarize"]), CLASSICAL, page)
        while stream.counts.frames < FRAMES:
            pass
        list(live.follow(stream, threading.Event()))
        assert live.losses.frames + stream.counts.dropped == FRAMES
        assert stream.counts.dropped >= FRAMES - 8
        assert f"{stream.counts.dropped} of {FRAMES} frames were dropped" in stream.troubles()[0]


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed (apt-get install chromium)")
def test_a_browser_shows_it_while_it_runs(walk, tmp_path):
    inputs = prepare(Inputs(PRESETS["radarize"]), CLASSICAL)
    with LivePage("127.0.0.1:0") as page, Browser(page.url, tmp_path / "profile") as browser:
        browser.wait("document.getElementById('state').textContent == 'waiting for frames'")
        browser.wait("events.readyState == 1")
        shown = threading.Event()

        def run() -> None:
            with Replay(walk, speed=0.5, slots=FRAMES) as stream:
                list(Live(inputs, CLASSICAL, page).follow(stream, shown))

        thread = threading.Thread(target=run)
        thread.start()
        text = "document.getElementById('{}').textContent".format
        browser.wait(f"{text('state')} == 'live'")
        browser.wait("document.getElementById('fan').naturalWidth == 260 && picture != null && pose != null")
        assert browser.evaluate("document.getElementById('doppler').naturalWidth") == 121
        assert browser.evaluate("document.getElementById('bar').children.length") >= 6
        assert "of 33.3 ms a frame" in browser.evaluate(text("stages")) and browser.evaluate(text("dropped")) == "0"
        drawn = "new Set(at('map').getContext('2d').getImageData(0, 0, at('map').width, at('map').height).data).size"
        assert browser.evaluate(drawn) > 4
        browser.screenshot(tmp_path / "live.png")
        browser.wait(f"{text('state')} == 'ended'")
        thread.join()
        assert browser.evaluate("pose[0]") > 0.05  # ahead
        assert browser.evaluate("performance.getEntriesByType('resource').map(r => r.name)") == [page.url + "events"]
        assert browser.errors == []


def test_the_command_follows_a_radar_and_records(tmp_path):
    virtual.record(tmp_path / "played.h5", SMALL, 40)
    (tmp_path / "small.cfg").write_text(write_cfg(SMALL))
    with emulated(tmp_path / "played.h5") as (emulator, where):
        options = ["--port", emulator.port, "--host", where.host, "--dca", where.dca, "--address", "127.0.0.1:0"]
        options += ["--command-port", str(where.command_port), "--data-port", str(where.data_port), "--frames", "30"]
        files = ["--config", str(tmp_path / "small.cfg"), "-o", str(tmp_path / "live.h5")]
        done = CliRunner().invoke(app, ["live", *options, *files])
    assert done.exit_code == 0, done.exception
    assert "page: http://127.0.0.1:" in done.stdout and "30 frames, " in done.stdout
    with Recording(tmp_path / "live.h5") as recording, Recording(tmp_path / "played.h5") as played:
        assert np.array_equal(recording.adc(0, 99), played.adc(0, 30)) and "dropped" not in done.stderr
        assert recording.attributes["source"] == f"radar at {emulator.port}, DCA1000 at 127.0.0.2"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["live"], "--config is missing"),
        (["live", "--config", "radarize"], "--port is missing"),
        (["live", "--replay", "a.h5", "--port", "b"], "--replay a.h5 is given with --config or --port"),
        (["capture", "--config", "radarize", "--port", "/dev/ttyNONE", "-o", "a.h5"], "no such serial port"),
    ],
)
def test_options_that_do_not_go_together(arguments, words):
    done = CliRunner().invoke(app, arguments)
    assert isinstance(done.exception, InputError) and words in str(done.exception)


def test_the_page_gives_latecomers_the_newest_and_ends():
    with LivePage("127.0.0.1:0") as page:
        for number in range(3):
            page.send("frame", {"number": number})
        page.send("end", {})
        assert urllib.request.urlopen(page.url).read().startswith(b"<!doctype html>")
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(page.url + "other")
        events = urllib.request.urlopen(page.url + "events")
        got = [events.readline().decode().strip() for _ in range(5)]
        assert got[0] == "event: frame" and json.loads(got[1].removeprefix("data: ")) == {"number": 2}
        assert got[3] == "event: end" and page.watched
    assert b"frame" not in events.read()


def test_addresses_that_are_taken_or_none():
    with LivePage("127.0.0.1:0") as page:
        taken = page.url.removeprefix("http://").strip("/")
        for address, words in ((taken, "in use"), ("127.0.0.1", "no port number"), ("192.0.2.1:80", "assign")):
            with pytest.raises(InputError, match=f"--address {address}: .*{words}.*, expected HOST:PORT"):
                LivePage(address)


def test_a_recording_that_cannot_be_played(tmp_path):
    with RecordingWriter(tmp_path / "empty.h5", PRESETS["radarize"]):
        pass
    with pytest.raises(InputError, match="has no whole frame"):
        Replay(tmp_path / "empty.h5")


def test_the_map_of_an_hour_is_drawn_beside_the_frames(monkeypatch):
    """7,000 nodes: the frame loop is not delayed, and the next map draws only new nodes."""
    monkeypatch.setattr("radarize.capture.live._PAUSE", 0.0)
    config, angles = Inputs(SMALL).configuration.slam, np.linspace(0, 200, 7000)
    ranges = np.full(len(BEARINGS), 2.0)
    nodes = [Node.gather([Scan(float(k), np.zeros(3), BEARINGS, ranges)], config) for k in range(len(angles))]
    poses = np.stack([9 * np.cos(angles), 9 * np.sin(angles), angles], axis=1)
    with LivePage("127.0.0.1:0") as page:
        live = Live(Inputs(SMALL), CLASSICAL, page)
        slam, took = live.pipeline.slam, []
        for count in (6990, 7000):
            for pose in poses[len(slam.nodes) : count]:
                slam.graph.add_node(pose)
            slam.nodes[:] = nodes[:count]
            start = time.perf_counter()
            live._show_map()
            waited = time.perf_counter() - start
            live._drawn.result()
            took.append((waited, time.perf_counter() - start))
        assert max(waited for waited, _ in took) < 0.03
        assert took[1][1] < took[0][1] / 5
        whole = MapRenderer(config.grid).render(slam.nodes, slam.graph.poses)
        assert np.array_equal(live._drawing.render(slam.nodes, slam.graph.poses).probability, whole.probability)
        slam.graph._poses.values[:, 0] += 1.0  # a loop is closed: nothing is where it was drawn
        moved = live._drawing.render(slam.nodes, slam.graph.poses)
        assert moved.origin[0] == pytest.approx(whole.origin[0] + 1.0, abs=2 * config.grid.map_resolution)
