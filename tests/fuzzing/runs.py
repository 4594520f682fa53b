"""Fuzzing of run folders, logs and weights."""

import functools
import tempfile
from pathlib import Path

import numpy as np
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

import radarize.io.importers.bag  # noqa: F401 -- imported at first use, and what its libraries take is no input's memory
from radarize.evaluation.evaluate import evaluate
from radarize.learning.features.grid import MapGrid
from radarize.learning.nets.motion import RotationNet
from radarize.learning.nets.weights import Header, build, save
from radarize.learning.nets.weights import load as load_weights
from radarize.pipeline.log import Log
from radarize.pipeline.runfolder import RunFolder
from radarize.pipeline.runfolder.reader import SHAPES
from radarize.radar.presets import PRESETS
from radarize.signal.maps import MapMaker
from tests.evaluation.fake_run import write_run
from tests.fuzzing.damage import damaged, misspelled
from tests.fuzzing.hdf5 import altered, edits
from tests.fuzzing.reader import Reader, file


@functools.cache
def sound_run() -> dict[str, bytes]:
    """Files of a run with ground truth."""
    with tempfile.TemporaryDirectory() as name:
        folder = write_run(Path(name) / "RUN", walked=2.0)
        run = RunFolder(folder)
        run.write_metrics(evaluate(run))
        return {path.name: path.read_bytes() for path in folder.iterdir()}


def use_run(folder: Path) -> None:
    """Read all of a run."""
    Log.read(folder)
    run = RunFolder(folder)
    _ = run.unobservable_spans
    for part in ("facts", "methods", "metrics", "trajectory", "odometry", "reference", "map"):
        getattr(run, part)
    if run.map is not None:
        run.map.centers(run.map.occupied)
    for name in run.scans:
        _ = run.scans[name]


def run_file(name: str, inputs: SearchStrategy) -> Reader:
    """Run with one damaged file."""

    def place(data: bytes, folder: Path) -> Path:
        for other, content in sound_run().items():
            (folder / other).write_bytes(content)
        (folder / name).write_bytes(data)
        return folder

    return Reader(inputs, place, use_run, lambda data: len(data) + sum(map(len, sound_run().values())))


def run_scans() -> Reader:
    """A run's HDF5: damaged bytes, or valid HDF5 with other content."""
    seed = sound_run()["scans.h5"]
    damages = run_file("scans.h5", st.one_of(damaged([seed]), edits(SHAPES)))

    def place(what: bytes | list[tuple], folder: Path) -> Path:
        damages.place(what if isinstance(what, bytes) else seed, folder)
        if not isinstance(what, bytes):
            altered(seed, what, folder / "scans.h5")
        return folder

    return Reader(damages.inputs, place, use_run, lambda what: len(seed) + 2 * len(what))


def log() -> Reader:
    """Scans of any sensor in an npz."""
    fields = {"ranges": np.ones((6, 40)), "angle_min": -1.0, "angle_increment": 0.05, "range_max": 10.0}
    with tempfile.TemporaryDirectory() as name:
        path, seeds = Path(name) / "a.npz", []
        for save, more in ((np.savez, {}), (np.savez_compressed, {"times": np.arange(6.0)})):
            save(path, **fields, **more)
            seeds.append(path.read_bytes())
        np.savez_compressed(path, **fields | {"ranges": np.zeros((5000, 5000))})  # 200 MB in 195 kB
        seeds.append(path.read_bytes())
    return Reader(damaged(seeds), file("a.npz"), Log.read)


def weights() -> Reader:
    """Weights file of a network."""
    seeds = []
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "a.safetensors"
        for width in (2, 4):
            grid = MapGrid.of(PRESETS["radarize"], "range_azimuth")
            header = Header(kind="rotation", frames=2, maps=("range_azimuth",), width=width, grid=grid)
            seeds.append(save(build(RotationNet, header), header, path).read_bytes())
        _shown(path)  # what is imported and compiled at first use is no input's time
    cuts = [(8 + int.from_bytes(seed[:8], "little"), seed) for seed in seeds]
    # A header with other numbers and words before the same tensors, and its length right.
    heads = st.one_of(
        *(
            misspelled([seed[8:cut].decode()]).map(
                lambda head, rest=seed[cut:]: len(head).to_bytes(8, "little") + head + rest
            )
            for cut, seed in cuts
        )
    )
    return Reader(st.one_of(damaged(seeds), heads), file("a.safetensors"), _shown)


def _shown(path: Path) -> None:
    """Input maps of the network for a radar other than that of its training."""
    radar = PRESETS["long-range"]
    header = load_weights(path, RotationNet, radar)[1]
    made = {name: np.zeros((2, radar.samples, 80), np.float16) for name in header.maps}
    header.windows(radar, MapMaker, header.spacings).push(made, radar.frame_period * np.arange(2))
