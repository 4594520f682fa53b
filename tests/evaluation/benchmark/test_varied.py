"""Figures over what was varied, of several walks a value."""

import numpy as np
import pandas as pd
import pytest

from radarize.evaluation.benchmark.varied import ABLATION, FIGURES


def test_means_over_walks_and_their_standard_errors():
    rows = [("loops", 8, 1.0), ("loops", 16, 5.0), ("loops", 8, 3.0), ("loops", 16, 5.0), ("device", "ISK", 2.0)]
    frame = pd.DataFrame([{"ablation": a, "value": v, "methods": "doppler", "odometry": e} for a, v, e in rows])
    frame = frame.assign(**{name: np.nan for name in FIGURES if name != "odometry"})
    found = ABLATION.means(frame, "By parameter").frame.set_index(["ablation", "value"])
    assert [*found["walks"]] == [2, 2, 1] and [*found.index] == [("loops", 8), ("loops", 16), ("device", "ISK")]
    assert [*found["odometry ATE, m"]] == [2.0, 5.0, 2.0]
    assert [*found["odometry ATE, m +-"]] == pytest.approx([1.0, 0.0, np.nan], nan_ok=True)
    assert "map F1, %" not in found
