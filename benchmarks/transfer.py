"""Whether real captures look to the networks like simulated ones, before and after `radarsim calibrate`.

The public captures have chirps of their own, so each is compared with simulated frames of the same chirps, from a radar
that stands at many places, first with the default board's front end, then with the one fitted to the capture. Levels
are about each map's mean, as the networks see them.
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.results import FOLDER, SHARED, Data, NamedWalk, Page, script
from radarize.io.console import progress
from radarize.io.recording import Recording
from radarize.learning.training.dataset import recordings
from radarize.pipeline.methods import best_methods
from radarize.pipeline.run import run
from radarize.radar.config import RadarConfig
from radarize.signal.maps import MapMaker, maps_of
from radarsim.motion.planner import plan_motion
from radarsim.motion.trajectory import Motion
from radarsim.receiver.calibrate import calibrate
from radarsim.receiver.frontend_config import FrontEndConfig
from radarsim.scenario import Scenario
from radarsim.twin.likeness import frechet_distance, patch_statistics
from radarsim.world.scene import Scene
from tests.io.importers.public import captures

SCENES = ("office", "visitors", "buildings/b")


def standing(scene: Scene, count: int, rng: np.random.Generator) -> list[Motion]:
    """A radar at rest, at places of a walk."""
    walk = plan_motion(scene, "handheld", 60.0, rng)
    times = np.linspace(0, walk.duration, count + 2)[1:-1]
    turns = walk.rotation(times).as_euler("ZYX")
    return [Motion.still(place, *turn) for place, turn in zip(walk.position(times), turns, strict=True)]


def simulated(
    config: RadarConfig, board: FrontEndConfig | None, scenes: dict[str, tuple[Scene, list[Motion]]], seed: int
) -> dict[str, np.ndarray]:
    """Maps of a frame at every place, (frame, row, azimuth), by name; the same worlds whatever the board."""
    maker, parts = MapMaker(config), []
    for number, (scene, stays) in enumerate(scenes.values()):
        for second, motion in enumerate(stays):  # people move on meanwhile
            scenario = Scenario(scene, motion, config, board, seed + number)
            parts.append(maker(scenario.frames([second + 0.25]).samples))
    return {name: np.concatenate([part[name] for part in parts]) for name in maker.names}


def spread(folder: Path, count: int) -> list[dict[str, np.ndarray]]:
    """Maps of the middle frames of recordings spread over a data set."""
    paths, found = recordings(folder), []
    for path in paths[:: max(1, len(paths) // count)][:count]:
        with Recording(path) as recording:
            maker, middle = MapMaker(recording.config), len(recording) // 2
            found.append(maps_of(recording, middle, middle + 1, maker.names, maker))
    return found


def distances(maps: np.ndarray, real: np.ndarray) -> tuple[float, np.ndarray]:
    """Of a real frame from simulated ones, and of every simulated frame from the others, dB."""
    statistics, one = patch_statistics(maps), patch_statistics(real)
    every = [
        frechet_distance(frame, np.concatenate(np.delete(statistics, k, axis=0))) for k, frame in enumerate(statistics)
    ]
    return frechet_distance(one[0], np.concatenate(statistics)), np.array(every)


def refusal(path: Path) -> str:
    """What the networks say to a capture, and by what the pipeline goes through it without them."""
    with Recording(path) as recording:
        methods, why = best_methods(recording.config)
    with tempfile.TemporaryDirectory() as folder:
        run(path, Path(folder) / "run")
    words = [Path(word).name if word.startswith("/") else word for word in why.split()]  # without folders
    said = f"networks: {' '.join(words)}" if why else "the networks fit"
    return f"{said}; radarize run takes {methods['odometry']} and {methods['scans']} and goes through."


def draw(shown: dict[str, dict[str, dict[str, np.ndarray]]], path: Path) -> None:
    """Histograms of cell values about their map's mean, by capture and map."""
    from matplotlib.figure import Figure

    names = ("range_azimuth", "doppler_azimuth")
    figure = Figure(figsize=(3.2 * len(shown), 4.6), layout="constrained")
    axes = figure.subplots(len(names), len(shown), squeeze=False)
    bins = np.arange(-30, 50.5, 1.0)
    for column, (capture, sources) in enumerate(shown.items()):
        for row, name in enumerate(names):
            axis = axes[row, column]
            for source, maps in sources.items():
                level = maps[name].astype(float)
                level = level - level.mean(axis=(1, 2), keepdims=True)
                style = {"color": "k", "lw": 1.6} if source == "real" else {"lw": 1.0}
                axis.hist(level.ravel(), bins, density=True, log=True, histtype="step", label=source, **style)
            axis.set(title=f"{capture}: {name}", xlabel="dB about the mean", ylim=(1e-4, 1))
    axes[0, 0].legend(frameon=False)
    figure.savefig(path, dpi=80)


@script(
    "Real captures beside simulated frames, as the networks see them",
    captures=(SHARED, "folder of the public captures"),
    data=(Path, "a data set that networks were trained on, to compare with as well"),
    places=(8, "in each scene"),
    seed=(0, "of places and worlds"),
)
def main(options: argparse.Namespace) -> Page:
    rows, notes, shown = [], [], {}
    with tempfile.TemporaryDirectory() as temporary, progress("captures") as report:
        found = captures(options.captures, Path(temporary))
        loaded = {name: Scene.load(name) for name in SCENES}
        rng = np.random.default_rng(options.seed)
        scenes = {name: (scene, standing(scene, options.places, rng)) for name, scene in loaded.items()}
        trained = spread(options.data, 24) if options.data else []
        for done, (capture, path) in enumerate(found.items()):
            report(2 * done, 2 * len(found))
            with Recording(path) as recording:
                config = recording.config
                real = MapMaker(config)(recording.adc(0, 1))
            board = calibrate(path, Path(temporary) / f"{capture}.yaml").settings
            before = simulated(config, None, scenes, options.seed)
            report(2 * done + 1, 2 * len(found))
            after = simulated(config, board, scenes, options.seed)
            shown[capture] = {"real": real, "default board": before, "calibrated": after}
            for name, maps in real.items():
                first, _ = distances(before[name], maps)
                second, among = distances(after[name], maps)
                most = np.quantile(among, 0.95)
                row = {"capture": capture, "map": name, "before dB": first, "after dB": second}
                row["simulated frames: median, 95 % dB"] = f"{np.median(among):.2f}, {most:.2f}"
                row["inside"] = "yes" if second <= most else "no"
                if trained:
                    third, among = distances(np.concatenate([frame[name] for frame in trained]), maps)
                    row["from training data; 95 % of its own dB"] = f"{third:.2f}; {np.quantile(among, 0.95):.2f}"
                rows.append(row)
            notes.append(f"{capture}: {refusal(path)}")
        report(2 * len(found), 2 * len(found))
        real = Data.of("public captures and simulated frames", list(found.values()), options.seed)
        stands = [NamedWalk(name, options.seed, 0.0, simulated=True) for name in SCENES]
    draw(shown, FOLDER / "transfer.png")
    return Page(
        rows,
        data=replace(real, walks=(*real.walks, *stands)),
        notes=[
            "Fréchet distance of patch statistics (8 x 8 cells: quantiles of levels about the map's mean, steps "
            f"along rows and columns) of the real frame from {len(SCENES) * options.places} simulated ones of the same "
            f"chirps, in {', '.join(SCENES)}; before: default board, after: the board that `radarsim calibrate` fits "
            "to the capture. Inside: not farther than 95 % of simulated frames are from the others.",
            "Each capture is a single frame of a room that nobody described: a part of the distance is the room's. The "
            "pcap's chirps are assumed, and it has one antenna, so no azimuth.",
            "Training data, where given, has the networks' own grid and mostly moves; the captures stand still.",
            *notes,
            "![Histograms](transfer.png)",
        ],
    )
