"""The Radarize data set's bags: imported once, with the paper's buildings, platforms and splits, and compared on."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from radarize.evaluation.benchmark import archive as archive_module
from radarize.evaluation.benchmark.archive import bags, import_archive, splits
from radarize.evaluation.benchmark.dataset import DataSet
from radarize.evaluation.benchmark.run import benchmark
from radarize.evaluation.benchmark.study import Options
from radarize.io.errors import InputError
from radarize.io.exporters import export
from radarize.io.recording import Recording, RecordingWriter, Stream
from radarize.io.yamlfile import read_yaml
from radarize.radar.presets import PRESETS
from tests.evaluation.benchmark.rooms import write_room

#: Of the artefact's test parts: random-0; random-0; none.
NAMES = "bot_ece_basement_1", "cart_sc_0", "walk_csl_upper_9"


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """Three bags of noise along an exact path."""
    folder = tmp_path_factory.mktemp("archive")
    for seed, name in enumerate(NAMES):
        room = write_room(folder / f"{name}.h5", 40, seed)
        export(_with_the_archives_radar(room), "radarize-ae", folder / f"{name}.bag")
    (folder / "broken.bag").write_bytes(b"nothing")
    return folder


def _with_the_archives_radar(room):
    """The same walk with samples of the preset, 40 frames at 30 Hz."""
    config = PRESETS["radarize"]
    rng = np.random.default_rng(0)
    path = room.with_suffix(".full.h5")
    with Recording(room) as source:
        pose, count = source.read("truth/pose"), len(source)
    times = config.frame_period * np.arange(count)
    streams = {"truth/time": Stream((), "f8", "s", ""), "truth/pose": Stream((7,), "f8", "m", "")}
    with RecordingWriter(path, config, streams=streams) as writer:
        adc = rng.integers(-99, 99, (count, *config.frame_shape), np.int16)
        rows = {"truth/time": times + config.burst_center, "truth/pose": pose}
        writer.append(adc, times, np.ones((count, config.loops, 3), bool), rows=rows)
    return path


def test_bags_become_recordings_with_platform_and_building(archive, tmp_path):
    reported = []
    import_archive(archive, tmp_path, lambda done, total: reported.append((done, total)))
    found = {case.name: (case.building, case.platform) for case in DataSet.load(tmp_path).cases}
    assert found == {
        "bot_ece_basement_1": ("C", "robot"), "cart_sc_0": ("A", "cart"), "walk_csl_upper_9": ("B", "handheld")
    }  # fmt: skip
    assert reported[-1] == (3, 3)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.h5")}
    import_archive(archive, tmp_path, lambda done, total: None)
    assert before == {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.h5")}


def test_a_damaged_bag_is_named_and_the_others_are_imported(archive, tmp_path):
    source = tmp_path / "bags"
    source.mkdir()
    shutil.copy(archive / "cart_sc_0.bag", source)
    (source / "cart_sc_1.bag").write_bytes(b"nothing")
    import_archive(source, tmp_path / "out", lambda done, total: None)
    (failed,) = json.loads((tmp_path / "out" / "dataset.json").read_text())["failed"]
    assert "cart_sc_1.bag" in failed
    (source / "cart_sc_0.bag").unlink()
    with pytest.raises(InputError, match="cart_sc_1.bag"):
        import_archive(source, tmp_path / "none", lambda done, total: None)


def test_splits_are_the_artefacts():
    names = [*NAMES, "walk_sc_office_3", "walk_ece_upper_0", "bot_beckman_5thfloor_1"]
    found = splits(names)
    assert sorted(found) == ["building-A", "building-B", "building-C", "platform", *(f"random-{k}" for k in range(5))]
    assert found["random-0"]["test"] == ["bot_ece_basement_1", "cart_sc_0", "bot_beckman_5thfloor_1"]
    assert found["random-0"]["train"] == ["walk_sc_office_3", "walk_ece_upper_0"]
    assert not any("walk_csl_upper_9" in sum(found[f"random-{k}"].values(), []) for k in range(5))
    assert found["platform"]["test"] == ["bot_beckman_5thfloor_1", "bot_ece_basement_1", "cart_sc_0"]
    assert found["building-A"]["test"] == ["cart_sc_0", "walk_sc_office_3"]
    for parts in found.values():
        assert not set(parts["train"] + parts["validation"]) & set(parts["test"])


def test_every_recording_of_the_artefact_tests_at_most_as_often_as_it_is_drawn():
    """126 recordings; a split has 27 to 29 that test (20 %) and 12 or 13 that validate (10 %)."""
    listed = read_yaml(Path(archive_module.__file__).with_name("archive.yaml"))
    assert len(listed) == 126
    for k in range(5):
        parts = [word[k] for word in listed.values()]
        assert 27 <= parts.count("e") <= 29 and 12 <= parts.count("v") <= 13 and 83 <= parts.count("t") <= 84


def test_the_papers_tables_come_of_a_folder_of_bags(archive, tmp_path):
    """The path is known to 1e-5 m; of noise alone, odometry stands still, and its error is that of a point."""
    found = benchmark("odometry", archive, tmp_path, Options(["doppler"]))["odometry"]
    (table,) = [t for t in found.tables if "paper's protocol" in t.title]
    (row,) = table.frame.to_dict("records")
    assert row["recordings"] == 2
    with Recording(tmp_path / "recordings" / "cart_sc_0.h5") as imported, Recording(archive / "cart_sc_0.h5") as true:
        known = np.isfinite(imported.read("truth/pose")[:, 0])
        assert np.abs(imported.read("truth/pose")[known, :2] - true.read("truth/pose")[known, :2]).max() < 0.01
        assert known.mean() > 0.9


def test_a_folder_of_other_bags_is_named(tmp_path):
    (tmp_path / "other.bag").touch()
    assert bags(tmp_path) == []
    with pytest.raises(InputError, match="holds no bags of the Radarize data set"):
        import_archive(tmp_path, tmp_path / "out", lambda done, total: None)
    with pytest.raises(InputError, match=r"holds no recordings, expected \*.h5, or bags such as"):
        benchmark("odometry", tmp_path, tmp_path / "out", Options())
