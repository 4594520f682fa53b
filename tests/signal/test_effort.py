"""Radars whose frames are much larger than the preset's: memory is bounded, and a remark states the cost."""

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from radarize.cli import app
from radarize.io.recording import RecordingWriter
from radarize.odometry.rotation import MapRotation, _reduce_doppler
from radarize.radar.limits import check_limits
from radarize.radar.presets import PRESETS
from radarize.signal.effort import effort, together
from radarize.signal.heatmaps import Heatmaps

PRESET = PRESETS["radarize"]
LONG = {"ramp_end_time": 100e-6, "adc_start_time": 5e-6, "sample_rate": 12.5e6}
LARGEST = PRESET.model_copy(update=LONG | {"samples": 1024, "slope": 4e12, "loops": 255, "frame_period": 1.3})
ALLOWED = [
    PRESETS["radarhd"],
    PRESET.model_copy(update={"frame_period": 1.0, "slope": 10e12}),
    PRESET.model_copy(update={"loops": 255, "frame_period": 0.3}),
    PRESET.model_copy(update=LONG | {"samples": 1024, "slope": 30e12, "frame_period": 0.2}),
    LARGEST,
]


@pytest.mark.parametrize("config", ALLOWED, ids=lambda c: f"{c.samples}-{c.loops}-{c.frame_period}")
def test_rotation_looks_at_so_many_cells_and_no_more(config):
    """The number of cells determines the time of all its steps."""
    check_limits(config)
    rotation, rng = MapRotation(Heatmaps(config)), np.random.default_rng(0)
    shape = (1, config.samples, config.loops, len(config.slot) * len(config.rx))
    spectrum = torch.as_tensor((rng.normal(size=shape) + 1j * rng.normal(size=shape)).astype(np.complex64))
    seen = []
    limited = rotation._heatmaps.limited
    rotation._heatmaps.limited = lambda cells, limit: (seen.append(cells.shape), limited(cells, limit))[1]
    feature = rotation.features(spectrum)
    assert seen[0][1] <= 256 and seen[0][2] <= 64
    assert feature.shape[1] == len(rotation._ranges) <= 256
    assert len(rotation._map._grid.mean) <= 640


def test_the_strongest_of_neighbouring_speeds_are_what_is_left():
    """Against brute force; a frame with as few speeds as the preset's is unchanged."""
    rng = np.random.default_rng(0)
    cells = (rng.normal(size=(2, 3, 200, 6)) + 1j * rng.normal(size=(2, 3, 200, 6))).astype(np.complex64)
    left = _reduce_doppler(torch.as_tensor(cells)).numpy()
    assert left.shape == (2, 3, 50, 6)
    for frame, reach, group in np.ndindex(2, 3, 50):
        four = cells[frame, reach, 4 * group : 4 * group + 4]
        assert np.array_equal(left[frame, reach, group], max(four, key=lambda each: (abs(each[:4]) ** 2).sum()))
    few = torch.as_tensor(cells[:, :, :64])
    assert _reduce_doppler(few) is few


def test_there_is_a_remark_before(tmp_path):
    assert effort(PRESET, 10) == "" and together(PRESET) == 16
    assert together(LARGEST) * LARGEST.frame_bytes <= 32 << 20
    times = 1024 * 255 / 96 / 32
    assert f"has {times:.1f} times the samples" in effort(LARGEST, 3) and "each of the 3 " in effort(LARGEST, 3)
    path, large = tmp_path / "large.h5", PRESET.model_copy(update={"loops": 128, "frame_period": 0.2})
    with RecordingWriter(path, large) as writer:
        noise = np.random.default_rng(0).integers(-200, 200, (2, *large.frame_shape))
        writer.append(noise.astype(np.int16), np.arange(2) * 0.2)
    assert effort(large, 2) in CliRunner().invoke(app, ["info", str(path)]).output.replace("\n", " ")
    found = CliRunner().invoke(app, ["run", str(path), "-o", str(tmp_path / "run"), "--odometry", "doppler"])
    assert f"warning: {effort(large, 2)}" in found.output
