"""Reports: whole, self-contained, and drawn by a browser without an error."""

import re
import shutil
import subprocess

import numpy as np
import pytest

from radarize.errors import InputError
from radarize.radar.presets import PRESETS
from radarize.recording import Product, RecordingWriter
from radarize.report.drawings import canvas, draw_doppler, draw_fan
from radarize.report.recording import report_recording
from radarize.report.run import report_run
from tests.evaluation.fake_run import write_run

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.fixture(scope="module")
def run_page(tmp_path_factory):
    return report_run(write_run(tmp_path_factory.mktemp("run") / "walk"))


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A static echo at bin 40, with noise, lost chirps and a true pose."""
    config = PRESETS["radarize"]
    path = tmp_path_factory.mktemp("recording") / "static.h5"
    rng = np.random.default_rng(0)
    beat = 800 * np.exp(2j * np.pi * 40 * np.arange(config.samples) / config.samples)
    adc = np.broadcast_to(np.stack([beat.real, beat.imag], axis=-1), (4, *config.frame_shape))
    adc = np.rint(adc + rng.normal(0, 5, adc.shape)).astype(np.int16)
    valid = np.ones(adc.shape[:3], bool)
    valid[2, 5:9] = False
    poses = np.tile([1.0, 2, 0, 0, 0, 0, 1], (4, 1))
    products = {"truth/pose": Product(poses, "m", "poses"), "truth/time": Product(np.arange(4.0), "s", "stamps")}
    with RecordingWriter(path, config, products=products) as writer:
        writer.append(adc, np.arange(4) * config.frame_period, valid)
    return path


@pytest.fixture(scope="module")
def recording_page(recording):
    return report_recording(recording)


@pytest.mark.parametrize("page", ["run_page", "recording_page"])
def test_page_needs_nothing_else(page, request):
    path = request.getfixturevalue(page)
    assert path.stat().st_size < 8e6
    text = path.read_text()
    outside = re.sub(r"<script>.*?</script>", "", text, flags=re.S)
    assert not re.search(r"""(src|href)=["'](?!data:)""", outside) and "@import" not in outside
    assert text.count("get_plotlyjs") == 0 and "plotly.js v" in text


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed (apt-get install chromium)")
@pytest.mark.parametrize("page", ["run_page", "recording_page"])
def test_a_browser_draws_it_without_errors(page, request, tmp_path):
    path = request.getfixturevalue(page)
    flags = "--headless --no-sandbox --disable-gpu --no-first-run --disable-background-networking"
    flags += " --disable-component-update --disable-sync --enable-logging=stderr --virtual-time-budget=8000 --dump-dom"
    offline = ["--host-resolver-rules=MAP * ~NOTFOUND", f"--user-data-dir={tmp_path}"]
    command = [CHROMIUM, *flags.split(), *offline, path.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0
    assert [line for line in done.stderr.splitlines() if "CONSOLE" in line] == []
    plots = len(re.findall(r'<div id="plot-\d+"', path.read_text()))
    drawn = set(re.findall(r'<div id="(plot-\d+)" class="plotly-graph-div js-plotly-plot"', done.stdout))
    assert plots >= 3 and len(drawn) == plots


def test_run_page_tells_the_result(run_page):
    text = run_page.read_text()
    for words in ("Trajectory and map", "Error over time", "Velocity", "Heat maps and scans", "first-echo", "2.13.0"):
        assert words in text
    assert text.count("<img alt=") == 3  # one picture for each sample frame
    shown = re.sub(r"<script.*?</script>|<img[^>]*>", "", text, flags=re.S)
    assert not re.search(r"\b(nan|None|inf)\b", shown)


def test_run_without_truth_is_drawn_too(tmp_path):
    text = report_run(write_run(tmp_path / "blind", truth=False)).read_text()
    assert "Trajectory and map" in text and "Error over time" not in text


def test_recording_page_names_its_echo(recording_page):
    text = recording_page.read_text()
    resolution = PRESETS["radarize"].range_resolution
    assert re.search(rf"Echoes: {40 * resolution:.2f} m \(0 dB\)", text)
    assert "lost chirps a frame" in text and "True trajectory" in text
    assert "chirps lost (12)" in text


def test_one_antenna_gives_no_maps(tmp_path):
    config = PRESETS["radarize"].model_copy(update={"rx": (0,), "tx_order": (0,)})
    with RecordingWriter(tmp_path / "one.h5", config) as writer:
        writer.append(np.ones((1, *config.frame_shape), np.int16), np.zeros(1))
    assert "no maps over azimuth" in report_recording(tmp_path / "one.h5").read_text()


def test_bad_input_is_one_sentence(tmp_path):
    with pytest.raises(InputError, match="no trajectory.tum"):
        report_run(tmp_path)
    with RecordingWriter(tmp_path / "empty.h5", PRESETS["radarize"]):
        pass
    with pytest.raises(InputError, match="has no whole frame"):
        report_recording(tmp_path / "empty.h5")


def test_left_is_drawn_left():
    figure, axes = canvas(2)
    ranges, azimuths = np.linspace(0, 4, 41), np.radians(np.arange(-60.0, 61.0))
    power = np.full((41, 121), 1e-3)
    power[20, 100] = 1.0  # 2 m, 40 deg to the left
    draw_fan(axes[0, 0], power, ranges, azimuths, "fan")
    mesh = axes[0, 0].collections[0]
    corners = mesh.get_coordinates()[:-1, :-1].reshape(-1, 2)
    x, y = corners[np.argmax(mesh.get_array().ravel())]
    assert x == pytest.approx(-2 * np.sin(np.radians(40)), abs=0.1)
    assert y == pytest.approx(2 * np.cos(np.radians(40)), abs=0.1)
    # Moving left: what is left comes closer; the ridge rises towards the left edge, which is positive azimuth.
    speeds = np.linspace(-1, 1, 21)
    draw_doppler(axes[0, 1], np.ones((21, 121)), speeds, azimuths, "doppler", np.array([0.0, 0.5]))
    line = axes[0, 1].lines[0]
    assert line.get_ydata()[np.argmin(line.get_xdata())] == pytest.approx(0.5 * np.sin(np.radians(60)))
    assert axes[0, 1].get_xlim()[0] < axes[0, 1].get_xlim()[1]
