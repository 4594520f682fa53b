"""Scan errors and path types of wrong returns, on constructed scans."""

import numpy as np
import pytest

from radarize.evaluation.scans import scan_errors, true_ranges, wrong_by_path_type

NOTHING = np.inf


def test_every_bearing_is_counted_once():
    true = np.array([[2.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0, NOTHING]])
    #                 right near  deep  none   jamb  deep   right too short: nothing is there
    measured = np.array([[2.05, 1.8, 2.4, NOTHING, 2.0, 3.19, 3.0, 2.5]])
    found = scan_errors(measured, true)
    assert found["within_10cm"] == pytest.approx(2 / 7)
    assert found["beside"] == pytest.approx(3 / 7)  # the jamb's neighbour is at 2 m
    assert found["returned"] == pytest.approx(6 / 7)
    assert found["short"] == pytest.approx(3 / 7) and found["beyond"] == pytest.approx(2 / 7)
    assert found["through"] == pytest.approx(1 / 7)  # 3.19 is not yet through
    assert found["median"] == pytest.approx(0.2)


def test_returns_of_the_next_bearing_are_not_behind_a_wall_at_a_glancing_angle():
    """In a corridor 1 m from the wall, 1 deg at 3 m moves the wall by 15 cm, at 4 m by 27 cm."""
    azimuths = np.radians(np.arange(15.0, 45.0))
    true = (1 / np.sin(azimuths))[None]
    beside = np.roll(true, 1, axis=1)  # each bearing returns the range of the bearing to its right
    beside[:, 0] = NOTHING
    found = scan_errors(beside, true)
    assert found["through"] == 0 and found["beyond"] > 0.3 and found["within_10cm"] < 0.7
    assert scan_errors(true + 0.5, true)["through"] > 0.8


def test_nothing_returned_and_nothing_there():
    nothing = np.full((2, 3), NOTHING)
    found = scan_errors(nothing, np.ones((2, 3)))
    assert found["returned"] == 0 and found["through"] == 0 and np.isnan(found["within_10cm"])
    found = scan_errors(np.ones((2, 3)), nothing)
    assert found["short"] == 1 and np.isnan(found["returned"])


def test_bearings_are_matched_by_angle():
    true = np.array([[1.0, 2.0, 3.0, 4.0, 5.0]])
    found = true_ranges(np.radians([-1.0, 1.0]), true, np.radians([-2.0, -1.0, 0.0, 1.0, 2.0]))
    np.testing.assert_array_equal(found, [[2.0, 4.0]])


def test_path_types_of_wrong_returns():
    ranges, azimuths = 0.1 * np.arange(50), np.radians([-1.0, 0.0, 1.0])
    cause = np.full((2, 50, 3), 255, np.uint8)
    cause[0, 30, 0] = 1  # a ghost at 3 m on the right, in the first scan
    cause[:, 20] = 1  # and one upon the wall
    cause[0, 10, 2] = 0  # the wall's own sidelobe, too near
    true = np.array([[2.0, 2.0, 2.0], [2.0, 2.0, NOTHING]])
    measured = np.array([[3.02, 2.05, 0.98], [1.5, 0.0, 2.04]])
    found = wrong_by_path_type(measured, true, azimuths, cause, ranges, azimuths, ("direct", "ghost"))
    # Five returns: a ghost, correct, direct; noise, none, and a ghost without a wall in range.
    assert found == pytest.approx({"direct": 0.2, "ghost": 0.4, "noise": 0.2})
    wrong = 1 - scan_errors(measured, true)["within_10cm"]
    assert sum(found.values()) == pytest.approx(wrong)
