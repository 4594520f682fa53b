"""Curves over what was varied."""

import matplotlib.pyplot as plt
import numpy as np

from radarize.evaluation.report.curves import curves


def test_curves():
    """A row for each figure, a column for each place, a line for each method, in the order of severity."""
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


def test_curves_over_names():
    """What has no number stands in the order it is given."""
    rows = [
        {"ablation": "device", "value": name, "scans": "first-echo", "odometry": error}
        for name, error in (("IWR6843ISK", 0.2), ("IWR1843BOOST", 0.1))
    ]
    figure = curves(rows, over="value", panel="ablation", names=("odometry",))
    axis = figure.axes[0]
    assert [label.get_text() for label in axis.get_xticklabels()] == ["IWR6843ISK", "IWR1843BOOST"]
    np.testing.assert_allclose(axis.get_lines()[0].get_xydata(), [[0, 0.2], [1, 0.1]])
    plt.close(figure)
