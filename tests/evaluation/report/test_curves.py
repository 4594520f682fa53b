"""Plots of metrics over a varied quantity."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from radarize.evaluation.report.curves import curves


def test_curves():
    """There is a row for each metric, a column for each place, and a line for each method, in order of severity."""
    rows = [
        {"stress": place, "severity": level, "scans": scans, "ghosts": 0.1 * level, "missed": None if level else 0.5}
        for place in ("corner", "shelves")
        for level in (2, 0, 1)
        for scans in ("first-echo", "threshold")
    ]
    figure = curves([*rows, rows[0] | {"ghosts": 0.4}], names=("ghosts", "missed"))  # two drives through the corner
    axes = np.array(figure.axes).reshape(2, 2)
    assert [axis.get_title() for axis in axes[0]] == ["corner", "shelves"]
    lines = axes[0, 1].get_lines()
    assert [line.get_label() for line in lines] == ["first-echo", "threshold"]
    np.testing.assert_allclose(lines[0].get_xydata(), [[0, 0], [1, 10], [2, 20]], atol=1e-9)
    np.testing.assert_allclose(axes[0, 0].get_lines()[0].get_xydata(), [[0, 0], [1, 10], [2, 30]], atol=1e-9)
    np.testing.assert_allclose(axes[1, 0].get_lines()[1].get_xydata(), [[0, 50]])
    assert axes[0, 0].get_ylim() == axes[0, 1].get_ylim()
    plt.close(figure)


def test_axes_have_quantity_and_unit_and_percentages_end_at_100():
    rows = [
        {"ablation": name, "value": value, "scans": "cfar", "missed": 0.98, "odometry": 1.0}
        for name, value in (("bandwidth", 1.68e9), ("bandwidth", 3.36e9), ("mine", 2))
    ]
    quantities = {"bandwidth": ("bandwidth, GHz", 1e-9)}
    figure = curves(rows, over="value", panel="ablation", names=("missed", "odometry"), quantities=quantities)
    axes = np.array(figure.axes).reshape(2, 2)
    assert [axis.get_xlabel() for axis in axes[1]] == ["bandwidth, GHz", "value"]
    assert [label.get_text() for label in axes[1, 0].get_xticklabels()] == ["1.68", "3.36"]
    assert axes[0, 0].get_ylim() == (0, 100) and axes[1, 0].get_ylim() == pytest.approx((0, 1.06))
    plt.close(figure)


def test_curves_over_names():
    """Values without a number are in the order of the rows."""
    rows = [
        {"ablation": "device", "value": name, "scans": "first-echo", "odometry": error}
        for name, error in (("IWR6843ISK", 0.2), ("IWR1843BOOST", 0.1))
    ]
    figure = curves(rows, over="value", panel="ablation", names=("odometry",))
    axis = figure.axes[0]
    assert [label.get_text() for label in axis.get_xticklabels()] == ["IWR6843ISK", "IWR1843BOOST"]
    np.testing.assert_allclose(axis.get_lines()[0].get_xydata(), [[0, 0.2], [1, 0.1]])
    plt.close(figure)
