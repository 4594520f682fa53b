"""Draws the moving picture of the README: the office with rays, the heat map of the same frame, and the map so far.

python -m docs.moving_picture runs/demo/office.h5        after `make demo`
"""

import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from PIL import Image

import radarize as rz
from radarize.evaluation.report.page import COLORS
from radarize.io.alignment import fitted
from radarize.io.recording import Recording
from radarize.io.tum import planar_poses
from radarize.pipeline.methods import choose_methods, make_pipeline
from radarize.pipeline.runfolder import OccupancyMap
from radarize.pipeline.session import batches, inputs_of
from radarize.signal.batch import Preprocessor
from radarsim.propagation.path_types import PathType
from radarsim.recording.simulate import planned
from radarsim.scenario import Scenario
from radarsim.world.preview.rendering import camera, cut_open, render
from radarsim.world.scene import Scene

HERE = Path(__file__).parent / "pictures"
#: Pictures, how long each is shown, and how long the last one is, ms.
COUNT, SHOWN, LAST = 90, 100, 1500
#: Width and height in pixels, pixels an inch, and the width of the scene's picture.
SIZE, DPI, VIEW = (900, 470), 100, 550
#: Dark on the pale rendering; in grey, direct paths are darker than ghost paths, and ghosts are dashed.
DIRECT, GHOST = "#123a8c", "#e08a00"
#: Strongest paths of each kind that are drawn, and the distance between their apparent places, m.
MOST_DIRECT, MOST_GHOSTS, APART = 30, 6, 0.4
#: Reflections after which a ray is given up, and the distance within which both directions must end, m.
REFLECTIONS, CLOSED = 3, 0.05
#: Of the heat map: range shown, m; levels of colour, and depth, dB.
REACH, LEVELS, DEPTH = 4.3, 16, 40.0


class Step(NamedTuple):
    """What SLAM has at the time of a picture, in its own frame."""

    frame: int
    occupied: Float[np.ndarray, "cell 2"]
    trajectory: Float[np.ndarray, "pose 3"]


class View:
    """Pixels of the rendering at points of the world."""

    def __init__(self, scene: Scene, width: int):
        corners = Scene(scene.name, cut_open(scene)).triangles.reshape(-1, 3)
        self._eye, target, self._tangent, self.height = camera(corners, width)
        self._ahead = (target - self._eye) / np.linalg.norm(target - self._eye)
        self._right = np.cross(self._ahead, [0, 0, 1])
        self._right /= np.linalg.norm(self._right)
        self.width, self._up = width, np.cross(self._right, self._ahead)

    def __call__(self, points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 2"]:
        """Column and row, pixels."""
        away = points - self._eye
        across, up = away @ self._right, away @ self._up
        scale = self.width / 2 / self._tangent / (away @ self._ahead)
        return np.stack([self.width / 2 + scale * across, self.height / 2 - scale * up], axis=-1)


def slam_steps(recording: Recording, frames: np.ndarray) -> tuple[list[Step], np.ndarray, np.ndarray]:
    """Map and trajectory at the time of each of these frames; turn and shift from SLAM's frame to the world's."""
    clip = recording[:]
    inputs = inputs_of(clip, None, None)
    methods, _ = choose_methods(recording.config)
    pipeline = make_pipeline(inputs, methods["odometry"], methods["scans"])
    steps: list[Step] = []
    for result in pipeline.run(batches(clip, Preprocessor(inputs.signal, inputs.every))):
        while len(steps) < len(frames) and len(result.frames) and result.frames[-1] >= frames[len(steps)]:
            steps.append(step_of(pipeline.slam, frames[len(steps)]))
    steps[-1] = step_of(pipeline.slam, frames[-1])
    times, poses = pipeline.slam.trajectory()
    turn, shift = fitted(rz.Trajectory(times, planar_poses(poses)).to_evo(), recording.truth.to_evo())
    return steps, turn[:2, :2], shift[:2]


def step_of(slam, frame: int) -> Step:
    grid = OccupancyMap.of(slam.map())
    return Step(int(frame), grid.centers(grid.occupied), slam.trajectory()[1])


def folded(
    scene: Scene, start: Float[np.ndarray, "3"], ends: Float[np.ndarray, "ray 3"]
) -> tuple[Float[np.ndarray, "ray point 3"], Bool[np.ndarray, "ray"]]:
    """Rays towards apparent places, reflected by each surface that they meet, and whether they end in one."""
    at = np.repeat(start[None], len(ends), axis=0)
    way = ends - at
    left = np.linalg.norm(way, axis=1)
    way /= np.maximum(left, 1e-9)[:, None]
    points = [at]
    for _ in range(REFLECTIONS + 1):
        distance, face = scene.hit(at + 1e-3 * way, way)
        step = np.where(distance > left - CLOSED, left, distance + 1e-3)
        at, left = at + step[:, None] * way, left - step
        points.append(at)
        normal = scene.normals[np.maximum(face, 0)]
        way = way - 2 * np.sum(way * normal, axis=1)[:, None] * normal
    return np.stack(points, axis=1), left < 1e-6


def rays(scenario: Scenario, time: float) -> dict[str, Float[np.ndarray, "ray point 3"]]:
    """The strongest direct and ghost paths of a frame, from the radar and back to it.

    Paths whose two directions do not end at one point are left out: those that pass through walls, and those with more
    scatterers than one.
    """
    frames = scenario.frames(np.array([time]))
    (paths,), (types,) = frames.paths, frames.types
    place = scenario.motion.position(frames.middles)[0]
    found = {}
    for name, chosen, most in (
        ("direct", types == PathType.DIRECT, MOST_DIRECT), ("ghost", types == PathType.GHOST, MOST_GHOSTS)
    ):  # fmt: skip
        rows = np.flatnonzero(chosen & ~paths.through)
        rows = rows[np.argsort(-np.abs(paths.amplitude[rows]), kind="stable")]
        ends = paths[rows].apparent(place)
        out, whole_out = folded(scenario.scene, place, ends[:, 0])
        back, whole_back = folded(scenario.scene, place, ends[:, 1])
        middle = ends.mean(axis=1)
        closed = np.linalg.norm(out[:, -1] - back[:, -1], axis=1) < CLOSED
        kept: list[int] = []
        for row in np.flatnonzero(closed & whole_out & whole_back):
            if len(kept) < most and (np.linalg.norm(middle[kept] - middle[row], axis=1) > APART).all():
                kept.append(row)
        found[name] = np.concatenate([out[kept], back[kept, -2::-1]], axis=1)
    return found


def draw_view(axis: Axes, picture: np.ndarray, view: View, scenario: Scenario, time: float) -> None:
    """The rendering with the rays of a frame and the radar's way so far."""
    axis.imshow(picture, extent=(0, view.width, view.height, 0), interpolation="none")
    way = view(scenario.motion.position(np.arange(0, time + 0.05, 0.1)))
    axis.plot(*way.T, color="0.15", lw=1.2, label="path of the radar")
    found = rays(scenario, time)
    for name, color, width, style in (("direct", DIRECT, 0.9, "-"), ("ghost", GHOST, 1.5, (0, (4, 1.2)))):
        lines = LineCollection(list(view(found[name])), colors=color, linewidths=width, linestyles=[style])
        axis.add_collection(lines)
        axis.plot([], [], color=color, lw=width + 0.5, ls=style, label=f"{name} paths")
    axis.plot(*way[-1], "o", ms=7, mfc="w", mec="k", mew=1.5, label="radar")
    axis.set(xlim=(0, view.width), ylim=(view.height, 0))
    axis.set_axis_off()


def draw_heat_map(axis: Axes, recording: Recording, frame: int):
    """Range-azimuth power from above, in few levels, which a GIF needs."""
    power = rz.range_azimuth(recording[frame])
    ranges, azimuths = power.range.values, power.azimuth.values
    far = ranges > 0.4
    level = 10 * np.log10(np.maximum(power.values / power.values[far].max(), 1e-9))
    x, y = -ranges[:, None] * np.sin(azimuths), ranges[:, None] * np.cos(azimuths)
    drawn = axis.contourf(
        x, y, level, np.linspace(-DEPTH, 0, LEVELS + 1), cmap="magma", extend="both", antialiased=False
    )
    axis.set(aspect="equal", xlim=(-REACH * 0.9, REACH * 0.9), ylim=(0, REACH))
    axis.set(xlabel="to the right, m", ylabel="forward, m", title="Range-azimuth power")
    return drawn


def draw_map(axis: Axes, plan: np.ndarray, step: Step, turn: np.ndarray, shift: np.ndarray) -> None:
    """Occupied cells and trajectory on the true floor plan."""
    axis.plot(plan[:, [0, 2]].T, plan[:, [1, 3]].T, color="0.75", lw=0.6)
    axis.plot([], [], color="0.75", lw=1.2, label="true floor plan")
    axis.plot(*(step.occupied @ turn.T + shift).T, "s", color="k", ms=1.0, label="map")
    axis.plot(*(step.trajectory[:, :2] @ turn.T + shift).T, color=COLORS["slam"], lw=1.8, label="SLAM trajectory")
    low, high = plan.reshape(-1, 2).min(axis=0) - 0.8, plan.reshape(-1, 2).max(axis=0) + 0.8
    axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="x, m", ylabel="y, m")
    axis.set_title("Map from the radar alone")


def pictures(recording: Recording) -> Iterator[Image.Image]:
    """One after another."""
    about = recording.attributes
    duration = len(recording) * recording.config.frame_period
    scenario, _, _ = planned(about["scene"], seed=int(about["seed"]), duration=duration, platform=about["platform"])
    frames = np.linspace(0, len(recording) - 1, COUNT + 1).astype(int)[1:]
    steps, turn, shift = slam_steps(recording, frames)
    view = View(scenario.scene, VIEW)
    rendering = Image.fromarray((255 * render(scenario.scene, 2 * VIEW, 200)).astype(np.uint8))
    rendering = rendering.resize((view.width, view.height), Image.Resampling.BOX)
    pale = 0.45 * np.asarray(rendering, float) / 255 + 0.55
    plan = recording.read("truth/floor_plan")
    for step in steps:
        figure = plt.figure(figsize=(SIZE[0] / DPI, SIZE[1] / DPI), dpi=DPI)
        width, height = SIZE
        scene = figure.add_axes((0, 1 - (34 + view.height) / height, view.width / width, view.height / height))
        heat = figure.add_axes((0.65, 0.58, 0.28, 0.34))
        bar = figure.add_axes((0.938, 0.6, 0.012, 0.28))
        floor = figure.add_axes((0.66, 0.1, 0.31, 0.36))
        time = recording.times[step.frame]
        draw_view(scene, pale, view, scenario, time)
        figure.text(0.01, 0.955, f"Simulated office, propagation paths at {time:4.1f} s", fontsize=10)
        figure.colorbar(draw_heat_map(heat, recording, step.frame), bar, ticks=[-40, -20, 0])
        bar.set_title("dB", fontsize=9)
        draw_map(floor, plan, step, turn, shift)
        handles = [*scene.get_legend_handles_labels()[0], *floor.get_legend_handles_labels()[0]]
        figure.legend(handles=handles, loc="lower left", ncols=4, fontsize=8, frameon=False, bbox_to_anchor=(0, 0))
        figure.canvas.draw()
        yield Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3])
        plt.close(figure)


def save(frames: list[Image.Image], path: Path, colors: int = 240) -> None:
    """Write a GIF of one palette for all pictures, in which what stays the same is transparent and takes few bytes."""
    sample = Image.fromarray(np.concatenate([np.asarray(frame) for frame in frames[:: len(frames) // 4]]))
    lines = [round(255 * part) for color in (DIRECT, GHOST, COLORS["slam"]) for part in to_rgb(color)]
    palette = sample.quantize(colors - len(lines) // 3, dither=Image.Dither.NONE)
    palette.putpalette(palette.getpalette()[: 3 * colors - len(lines)] + lines)
    drawn = [np.asarray(frame.quantize(palette=palette, dither=Image.Dither.NONE)) for frame in frames]
    changes = [np.where(new == old, colors, new) for old, new in pairwise(drawn)]
    first, *others = [Image.fromarray(each.astype(np.uint8), "P") for each in (drawn[0], *changes)]
    for each in (first, *others):
        each.putpalette([*palette.getpalette()[: 3 * colors], 255, 255, 255])
    times = [SHOWN] * len(others) + [LAST]
    options = {"duration": times, "loop": 0, "disposal": 1, "transparency": colors, "optimize": False}
    first.save(path, save_all=True, append_images=others, **options)


def main() -> None:
    plt.rcParams.update({"font.size": 9, "axes.titlesize": 10, "axes.labelsize": 9, "axes.linewidth": 0.6})
    save(list(pictures(rz.load(sys.argv[1]))), HERE / "radarize.gif")


if __name__ == "__main__":
    main()
