"""Real walks judged: a clone made up, whose lidar and radar see a wall."""

import json
import lzma

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from radarize import polar
from radarize.benchmark.real import median_error
from radarize.cli import app
from radarize.errors import InputError

FRAMES = 46


@pytest.fixture
def clone(tmp_path):
    folder = tmp_path / "dataset_5" / "test"
    for kind in ("radar", "lidar"):
        (folder / kind).mkdir(parents=True)
    radar, lidar = np.zeros((256, 64), np.uint8), np.zeros((256, 512), np.uint8)
    radar[76, 20:44], lidar[71, 160:352] = 255, 255  # 0.21 m farther
    for k in range(FRAMES):
        Image.fromarray(radar).save(folder / f"radar/R_7_{k}.png")
        Image.fromarray(lidar).save(folder / f"lidar/L_7_{k}.png")
    return tmp_path / "dataset_5"


def predictions(folder, row: int):
    """Of frames from the 40th on: the wall at a row, on the Cartesian grid."""
    cells = np.zeros((FRAMES - 40, *map(len, polar.GRID)), np.uint8)
    picture = np.zeros((256, 512), bool)
    picture[row, 160:352] = True
    at = [np.searchsorted(axis, each - 1e-9) for axis, each in zip(polar.GRID, polar.cartesian(picture).T, strict=True)]
    cells[:, at[0], at[1]] = 1
    folder.mkdir()
    with lzma.open(folder / "7.npz.xz", "wb") as file:
        np.savez(file, prediction=np.packbits(cells, axis=-1), frame=np.arange(40, FRAMES))


def test_every_walk_and_method_has_a_row(clone, tmp_path):
    predictions(tmp_path / "others", 71)
    done = CliRunner().invoke(app, [
        "benchmark", "real", "--data", str(clone), "--out", str(tmp_path / "out"), "--walks", "7",
        "--weights", str(tmp_path), "--predictions", f"others={tmp_path / 'others'}",
    ])  # fmt: skip
    assert done.exit_code == 0, done.exception
    rows = json.loads((tmp_path / "out" / "real.json").read_text())["tables"][0]["rows"]
    found = {row["method"]: row for row in rows}
    assert {row["walk"] for row in rows} == {7} and {"picture", "cfar", "first-echo", "others"} == found.keys()
    assert found["others"]["chamfer_m"] == 0 and found["others"]["frames"] == FRAMES - 40
    # A wall that is read 5 rows too far is off by that, 0.21 m, but for its ends.
    assert found["picture"]["mod_hausdorff_m"] == pytest.approx(0.21, abs=0.04)
    assert found["picture"]["chamfer_m"] == pytest.approx(0.21, abs=0.06)
    assert "all real" in (tmp_path / "out" / "real.md").read_text()


@pytest.mark.parametrize(("options", "words"), [
    (["--walks", "8"], "has no walk 8"), (["--walks", "x"], "expected numbers"),
    (["--predictions", "others"], "expected NAME=FOLDER"),
])  # fmt: skip
def test_what_is_not_there(clone, tmp_path, options, words):
    done = CliRunner().invoke(app, ["benchmark", "real", "--data", str(clone), "--out", str(tmp_path / "o"), *options])
    assert isinstance(done.exception, InputError) and words in str(done.exception)


def test_frames_that_are_alike_count_less():
    """Errors of an autoregressive process: the spread of medians over many of them is what one of them says."""
    rng = np.random.default_rng(0)
    told, medians = [], []
    for _ in range(200):
        values = np.zeros(600)
        for k, noise in enumerate(rng.normal(size=600)):
            values[k] = 0.9 * values[k - 1] + noise
        told.append(median_error(values))
        medians.append(np.median(values))
    assert np.median(told) == pytest.approx(np.std(medians), rel=0.25)
