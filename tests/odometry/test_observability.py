"""Spans in which motion is unobservable, of synthetic tracks."""

from types import SimpleNamespace

import numpy as np
import pytest

from radarize.odometry.observability import Observability

PERIOD = 0.05


def track(count, start=0.0, no_velocity=(), no_turn=()):
    """A walk at 1 m/s forwards."""
    frames = np.arange(count)
    step = np.zeros((count, 3))
    step[1:, 0] = PERIOD
    return SimpleNamespace(
        time=start + PERIOD * frames,
        step=step,
        velocity_seen=~np.isin(frames, no_velocity),
        turn_seen=~np.isin(frames, no_turn),
    )


def found(*tracks, period=PERIOD):
    observability = Observability(period)
    for each in tracks:
        observability.add(each)
    return observability


def test_a_span_is_from_the_last_observed_frame_to_the_last_unobserved_one():
    summary = found(track(200, start=100, no_velocity=range(40, 60))).found.model_dump()
    (span,) = summary["spans"]
    assert span["why"] == "no velocity"
    assert (span["start_s"], span["stop_s"]) == pytest.approx((100 + 39 * PERIOD, 100 + 59 * PERIOD))
    assert span["way_m"] == summary["way_m"] == pytest.approx(20 * PERIOD)
    assert summary["share_of_way"] == pytest.approx(20 / 199, abs=1e-4)


def test_short_spans_are_left_out_and_neighbours_joined():
    short = [*range(10, 15), *range(30, 35)]  # 0.25 s each, 0.8 s apart
    assert found(track(200, no_velocity=short)).found.model_dump() == {"share_of_way": 0.0, "way_m": 0.0, "spans": []}
    assert found(track(200, no_velocity=short)).warnings() == []
    (span,) = found(track(200, no_velocity=range(10, 15), no_turn=range(19, 24))).found.spans
    assert span.why == "no velocity and no turn"
    assert span.way_m == pytest.approx(10 * PERIOD)  # without the observed frames between them


def test_lost_frames_are_a_span_and_skipped_frames_are_not():
    whole = track(40)
    rows = np.r_[0:10, 25:40]
    gap = SimpleNamespace(**{name: values[rows] for name, values in vars(whole).items()})
    gap.step[10] *= 16
    (span,) = found(gap).found.spans
    assert span.why == "frames lost" and span.way_m == pytest.approx(16 * PERIOD)
    assert (span.start_s, span.stop_s) == pytest.approx((9 * PERIOD, 25 * PERIOD))
    whole.time *= 10
    assert found(whole, period=10 * PERIOD).found.spans == []
    whole.time /= 10
    at_the_end = found(whole)
    at_the_end.lost(39 * PERIOD, 5.0)
    at_the_end.lost(-1.0, 0.0)
    assert [span.start_s for span in at_the_end.found.spans] == pytest.approx([-1.0, 39 * PERIOD])
    assert {span.why for span in at_the_end.found.spans} == {"frames lost"}


def test_batches_do_not_matter():
    whole = track(120, no_velocity=range(7, 31), no_turn=range(28, 90))
    parts = Observability(PERIOD)
    for k in range(0, 120, 7):
        part = SimpleNamespace(**{name: values[k : k + 7] for name, values in vars(whole).items()})
        parts.add(part)
    assert parts.found.model_dump() == found(whole).found.model_dump() and len(parts.found.spans) == 1


def test_the_warning_counts_from_the_first_frame():
    observability = found(track(200, start=1.7e9, no_velocity=range(100, 130), no_turn=range(20, 28)))
    assert observability.warnings() == [
        "heading or velocity was unobservable in 2 spans, for 1.9 s and 19 % of the path, in the longest from 5.0 to "
        "6.5 s (no velocity); poses there are predictions"
    ]
