"""Spans in which odometry is degraded, their kind and advice: of synthetic tracks, and of a recording."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from radarize.cli import app
from radarize.evaluation.report.run import report_run
from radarize.io.console import run as run_app
from radarize.io.errors import InputError
from radarize.io.load import load
from radarize.io.recording import RecordingWriter
from radarize.pipeline.health import Health
from radarize.pipeline.pipeline import Pipeline, Result
from radarize.pipeline.run import run
from radarize.pipeline.runfolder import RunFolder
from radarize.radar.presets import PRESETS
from radarize.signal.bearings import BEARINGS
from radarize.signal.disturbance import Flaws
from tests.echoes import record
from tests.rooms import antenna_gain, furnished_room, walk

CONFIG, PERIOD, COUNT = PRESETS["radarize"], 0.05, 200
#: A single transmitter at the same loop time, with which speeds are ambiguous, and one with half the maximum speed.
SINGLE, SLOW = (
    CONFIG.model_copy(update={"tx_order": (0,), "idle_time": CONFIG.idle_time + more * CONFIG.chirp_time})
    for more in (2, 5)
)
pytestmark = pytest.mark.usefixtures("one_thread")


def result(start=1.7e9, fast=(), empty=(), no_turn=(), hit=(), dead=(), rx=0):
    """A walk at 1 m/s in a furnished room, with frames in which a condition differs."""
    frames = np.arange(COUNT)
    velocity = np.tile([1.0, 0.0], (COUNT, 1))
    velocity[list(fast)] = [0.0, -1.8]
    track = SimpleNamespace(
        time=start + PERIOD * frames, step=np.tile([PERIOD, 0, 0], (COUNT, 1)), velocity=velocity,
        velocity_seen=np.ones(COUNT, bool), turn_seen=~np.isin(frames, no_turn),
    )  # fmt: skip
    ranges = np.where(np.arange(len(BEARINGS)) % 10 == 0, 2.0, np.inf) * np.ones((COUNT, 1))
    ranges[list(empty)] = np.inf
    flaws = Flaws(np.zeros((COUNT, 32, 3), bool), np.zeros((COUNT, 4), bool), np.zeros((COUNT, 4), bool))
    flaws.disturbed[list(hit), 3, 1] = True
    flaws.dead[list(dead), rx] = True
    return Result(frames, track, ranges.astype(np.float32), flaws)


def health(radar=CONFIG, **conditions):
    found = Health(radar)
    whole = result(**conditions)
    for k in range(0, COUNT, 7):  # batches do not matter
        part = slice(k, k + 7)
        track = SimpleNamespace(**{name: values[part] for name, values in vars(whole.track).items()})
        found.add(Result(whole.frames[part], track, whole.ranges[part], Flaws(*(each[part] for each in whole.flaws))))
    return found


@pytest.mark.parametrize(
    ("condition", "kind", "advice"),
    [
        ("no_turn", "unobservable", "turn more slowly"),
        ("fast", "aliased", "speeds above 1.83 m/s are aliased: move more slowly, or use the `two-tx` preset"),
        ("empty", "out of reach", "few surfaces within 4.2 m: the `long-range` preset measures up to 20 m"),
        ("hit", "disturbed", "another radar may be near"),
        ("dead", "disturbed", "RX1 is dead"),
    ],
)
def test_each_kind_has_its_span_and_advice(condition, kind, advice):
    found = health(SINGLE, **{condition: range(40, 80), "start": 0.0})
    (span,) = found.found
    assert (span.kind, span.start_s, span.stop_s) == (kind, pytest.approx(39 * PERIOD), pytest.approx(79 * PERIOD))
    assert advice in span.advice and "\n" not in span.advice
    (warning,) = found.warnings()
    assert "from 1.9 to 4.0 s" in warning or "from 2.0 to 4.0 s" in warning


def test_a_walk_without_degradation_or_with_short_ones_has_no_findings():
    assert health().found == [] and health().warnings() == []
    blinks = [*range(10, 15), *range(50, 55)]
    assert health(fast=blinks, empty=blinks, no_turn=blinks, hit=blinks, dead=blinks).found == []


def test_speeds_resolved_by_several_transmitters_are_no_finding():
    """1.8 m/s is near the unambiguous speed of a loop in the preset, which resolves speeds up to 3 m/s."""
    assert health(fast=range(40, 80)).found == []
    slower = CONFIG.model_copy(update={"idle_time": CONFIG.idle_time + CONFIG.chirp_time})
    assert health(slower, fast=range(40, 80)).warnings() == []


def test_the_receiver_has_the_boards_number():
    radar = CONFIG.model_copy(update={"rx": (1, 2, 3)})
    assert health(radar, dead=range(COUNT), rx=2).found[0].advice.startswith("RX4 is dead")


def test_a_limit_below_walking_pace_is_a_warning_at_any_speed():
    (warning,) = Health(SLOW).warnings()
    assert warning == f"the configuration's maximum speed of {SLOW.max_velocity:.2f} m/s is below walking pace"
    (span,) = health(SLOW, fast=range(40, 80)).found  # at 1 m/s all echoes ahead alias
    assert "is below walking pace: the `two-tx` preset measures up to 5.5 m/s" in span.advice


def test_run_and_report_show_the_advice(tmp_path, capsys):
    """Half a second with a receiver that is dead and chirps that are disturbed."""
    rng = np.random.default_rng(0)
    times, room = np.arange(16) * CONFIG.frame_period, furnished_room(rng, density=6.0, boxes=4)
    adc = record(CONFIG, walk(rng, 2.0), *room, times, rng, 20.0, block=32, gain=antenna_gain)
    adc[:, 5, 2] += rng.normal(0, 3000, adc[:, 5, 2].shape).astype(np.int16)
    adc[:, :, :, 2] = 0
    with RecordingWriter(tmp_path / "walk.h5", CONFIG) as writer:
        writer.append(adc, times)
    choice = ["--odometry", "doppler", "--scans", "first-echo"]
    with pytest.raises(SystemExit) as stopped:
        run_app(app, "radarize", ["run", str(tmp_path / "walk.h5"), "-o", str(tmp_path / "RUN"), *choice])
    assert stopped.value.code == 0
    err, facts = capsys.readouterr().err, json.loads((tmp_path / "RUN" / "run.json").read_text())
    assert facts["chirps_disturbed"] == 16
    advice = {each["advice"] for each in facts["health"] if each["kind"] == "disturbed"}
    assert len(advice) == 2 and all(set(each) == {"kind", "start_s", "stop_s", "advice"} for each in facts["health"])
    page = report_run(tmp_path / "RUN").read_text()
    for each in advice:
        assert each in err and each in page
    assert any("RX3 is dead" in each for each in advice)


def test_frames_that_never_came_are_a_gap(tmp_path):
    """Stamps alone show that frames are missing: two seconds of them, and one frame."""
    rng = np.random.default_rng(0)
    sent = np.r_[0:6, 7:10, 70:76]
    times, room = sent * CONFIG.frame_period, furnished_room(rng, density=6.0, boxes=4)
    adc = record(CONFIG, walk(rng, 2.0), *room, times, rng, 20.0, block=32, gain=antenna_gain)
    with RecordingWriter(tmp_path / "walk.h5", CONFIG) as writer:
        writer.append(adc, times)
        assert writer.losses.warnings() == ["61 frames are missing between others"]
    folder = run(tmp_path / "walk.h5", tmp_path / "RUN", odometry="doppler", scans="first-echo").path
    facts = RunFolder(folder).facts
    gap = max(facts["blind"]["spans"], key=lambda span: span["stop_s"] - span["start_s"])
    assert "frames lost" in gap["why"] and gap["stop_s"] - gap["start_s"] > 1.9 and facts["frames_missing"] == 61
    assert any("frames did not arrive" in each["advice"] for each in facts["health"])
    assert any("from 0.3 to 2.3 s" in warning for warning in facts["warnings"])


def test_time_per_frame_is_that_of_the_frames_used(tmp_path, monkeypatch):
    monkeypatch.setattr(Pipeline, "seconds", {"slam": 1.0})
    with RecordingWriter(tmp_path / "walk.h5", CONFIG) as writer:
        noise = np.random.default_rng(0).integers(-200, 200, (8, *CONFIG.frame_shape), dtype=np.int16)
        writer.append(noise, np.arange(8) * CONFIG.frame_period)
    with load(tmp_path / "walk.h5") as recording:
        folder = run(recording[::4], tmp_path / "RUN", odometry="doppler", scans="first-echo").path
    assert RunFolder(folder).facts["ms_per_frame"] == {"slam": 500.0}


def test_damaged_facts_are_one_sentence(tmp_path):
    (tmp_path / "trajectory.tum").write_text("0 0 0 0 0 0 0 1\n")
    (tmp_path / "run.json").write_text(json.dumps({"health": [{"kind": "unobservable", "start_s": "noon"}]}))
    with pytest.raises(InputError, match="run.json: health.0.start_s is 'noon'"):
        _ = RunFolder(tmp_path).health
    (tmp_path / "run.json").write_text(json.dumps({"warnings": 3}))
    with pytest.raises(InputError, match="run.json: warnings is '3', expected a list"):
        _ = RunFolder(tmp_path).warnings
