"""Reports: whole, self-contained, and drawn by a browser without an error."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from radarize.evaluation.report.drawings import canvas, draw_doppler, draw_fan
from radarize.evaluation.report.recording import report_recording
from radarize.evaluation.report.run import report_run
from radarize.io.errors import InputError
from radarize.io.recording import Product, RecordingWriter, Stream
from radarize.pipeline.runfolder import RunFolder
from radarize.radar.presets import PRESETS
from tests.capture.browser import CHROMIUM, Browser
from tests.evaluation.fake_run import write_run

needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed (apt-get install chromium)")
#: What a run with two gaps says of itself.
BLIND = {
    "share_of_way": 0.125,
    "way_m": 2.25,
    "spans": [
        {"start_s": 3.0, "stop_s": 4.5, "way_m": 1.5, "why": "no match believed"},
        {"start_s": 10.0, "stop_s": 11.0, "way_m": 0.75, "why": "no <velocity>"},
    ],
}


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


@needs_browser
@pytest.mark.parametrize("page", ["run_page", "recording_page"])
def test_a_browser_draws_it_without_errors(page, request, tmp_path):
    path = request.getfixturevalue(page)
    plots = len(re.findall(r'<div id="plot-\d+"', path.read_text()))
    with Browser(path.as_uri(), tmp_path / "profile") as browser:
        browser.wait("document.readyState === 'complete'")
        assert plots >= 3
        browser.wait(f"document.querySelectorAll('.js-plotly-plot').length === {plots}")
        assert browser.errors == []


def test_run_page_tells_the_result(run_page):
    text = run_page.read_text()
    for words in ("Trajectory and map", "Error over time", "Velocity", "Heat maps and scans", "first-echo", "2.13.0"):
        assert words in text
    assert text.count("<img alt=") == 3  # one picture for each sample frame
    shown = re.sub(r"<script.*?</script>|<img[^>]*>", "", text, flags=re.S)
    assert not re.search(r"\b(nan|None|inf)\b", shown)


def tell(run: Path, **facts) -> Path:
    """Add to what a run says of itself."""
    path = run / "run.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | facts))
    return run


def listing(*folders: Path) -> dict[str, tuple[int, bytes]]:
    """All files with their times and contents."""
    files = [path for folder in folders for path in folder.rglob("*") if path.is_file()]
    return {str(path): (path.stat().st_mtime_ns, path.read_bytes()) for path in files}


def test_comparing_runs_writes_into_none_of_them(tmp_path):
    run, other = write_run(tmp_path / "run"), write_run(tmp_path / "other", seed=1)
    before = listing(run, other)
    page = report_run(run, tmp_path / "page.html", [other])
    assert "Beside other methods" in page.read_text()
    assert listing(run, other) == before
    report_run(run, None, [other])
    assert listing(other).items() <= before.items()
    assert set(listing(run, other)) - set(before) == {str(run / "report.html")}


@needs_browser
def test_names_are_data(tmp_path):
    """Of recordings, methods, attributes: neither a browser nor a plot takes them for markup."""
    evil = "<script>window.hacked = 1</script><b>[imu]</b> $x_"
    run = tell(write_run(tmp_path / "run"), recording=evil, methods={"odometry": evil, "scans": "'\"&amp;"})
    other = tell(write_run(tmp_path / "other", seed=1), methods={"odometry": evil, "scans": "[/x]"})
    with Browser(report_run(run, None, [other]).as_uri(), tmp_path / "a") as browser:
        browser.wait("document.querySelectorAll('.js-plotly-plot').length === 3")
        assert browser.evaluate("window.hacked") is None and browser.errors == []
        text = browser.evaluate("document.body.innerText")
        assert f"Radar-only SLAM on {evil}" in text and f"{evil} + '\"&amp;" in text and f"{evil} + [/x]" in text
        legend = browser.evaluate("[...document.querySelectorAll('#plot-1 .legendtext')].map(t => t.textContent)")
        assert f"odometry {evil} + [/x]" in legend

    config = PRESETS["radarize"].model_copy(update={"loops": 2, "samples": 16})
    path = tmp_path / "<img src=x onerror=window.hacked=1>[imu].h5"
    streams = {"<i>[imu]": Stream((1,), "f4", "<u>", evil)}
    with RecordingWriter(path, config, attributes={evil.replace("/", "|"): evil}, streams=streams) as writer:
        writer.append(np.ones((2, *config.frame_shape), np.int16), np.arange(2.0), rows={"<i>[imu]": np.zeros((2, 1))})
    with Browser(report_recording(path, tmp_path / "page.html").as_uri(), tmp_path / "b") as browser:
        browser.wait("document.readyState === 'complete'")
        assert browser.evaluate("window.hacked") is None and browser.errors == []
        text = browser.evaluate("document.body.innerText")
        assert f"Recording {path.name}" in text and "/<i>[imu]" in text and text.count(evil) == 2


@needs_browser
def test_methods_beside_each_other_sort(tmp_path):
    runs = [tell(write_run(tmp_path / n, seed=k), methods={"odometry": n}) for k, n in enumerate("bca")]
    with Browser(report_run(runs[0], None, runs[1:]).as_uri(), tmp_path / "profile") as browser:
        browser.wait("document.readyState === 'complete'")
        rows = "document.querySelector('table.sortable').rows"
        cells = f"[...{rows}].slice(1).map(r => r.cells[{{0}}].textContent)"
        browser.evaluate(f"{rows}[0].cells[0].click()")
        assert browser.evaluate(cells.format(0)) == ["a", "b", "c"]
        before = browser.evaluate(cells.format(4))
        browser.evaluate(f"{rows}[0].cells[4].click()")
        assert browser.evaluate(cells.format(4)) == sorted(before, key=float) and len(set(before)) == 3


@needs_browser
def test_where_odometry_was_blind_is_told_and_shaded(tmp_path):
    page = report_run(tell(write_run(tmp_path / "run"), blind=BLIND))
    with Browser(page.as_uri(), tmp_path / "profile") as browser:
        browser.wait("document.querySelectorAll('.js-plotly-plot').length === 3")
        text = browser.evaluate("document.body.innerText")
        assert "over 2.2 m, 12 % of the way" in text and "no match believed" in text and "no <velocity>" in text
        for plot in ("plot-2", "plot-3"):  # errors, velocities: both of two rows
            shapes = browser.evaluate(f"document.getElementById('{plot}').layout.shapes.map(s => [s.x0, s.x1])")
            assert sorted(map(tuple, shapes)) == [(3.0, 4.5)] * 2 + [(10.0, 11.0)] * 2


def test_blind_spans_are_counted_from_the_first_pose(tmp_path):
    """The run has stamps of its clock."""
    clock, run = 1.7e9, write_run(tmp_path / "run")
    poses = np.loadtxt(run / "trajectory.tum")
    np.savetxt(run / "trajectory.tum", poses + [clock, *[0] * 7], fmt="%.9f")
    assert RunFolder(run).unobservable_spans is None
    spans = [span | {"start_s": span["start_s"] + clock, "stop_s": span["stop_s"] + clock} for span in BLIND["spans"]]
    assert RunFolder(tell(run, blind=BLIND | {"spans": spans})).unobservable_spans.model_dump() == BLIND


def test_blind_spans_stand_in_one_table(tmp_path):
    """With advice, where there is some."""
    found = [{"kind": "blind", "start_s": 3.0, "stop_s": 4.5, "advice": "turn more slowly"}]
    run = tell(write_run(tmp_path / "run"), blind=BLIND)
    assert "blind from, s" in report_run(run).read_text()
    shown = report_run(tell(run, blind=BLIND, health=found)).read_text()
    assert "blind from, s" not in shown and "turn more slowly" in shown and "12 % of the way" in shown


def test_blindness_is_told_without_truth_too(tmp_path):
    seeing = {"share_of_way": 0.0, "way_m": 0.0, "spans": []}
    shown = report_run(tell(write_run(tmp_path / "run", truth=False), blind=seeing)).read_text()
    assert "Odometry was blind nowhere." in shown
    old = report_run(write_run(tmp_path / "old", truth=False)).read_text()
    assert "blind" not in re.sub(r"<script.*?</script>", "", old, flags=re.S)
    with pytest.raises(InputError, match=r"run.json: blind.way_m is .*-1"):
        report_run(tell(tmp_path / "run", blind=seeing | {"way_m": -1}))


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
