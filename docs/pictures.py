"""Draws the pictures of README and docs.

python -m docs.pictures                  plans and renderings of scenes
python -m docs.pictures REC.h5 RUN       also heat maps of a recording, and map and trajectories of a run

`heatmaps.png` is of the demo's recording, `run.png` of a longer walk, on which odometry drifts by metres:

    make demo
    radarsim simulate buildings/b -o runs/long.h5 --platform handheld --duration 200 --seed 1
    radarize run runs/long.h5 -o runs/long
    python -m docs.pictures runs/demo/office.h5 runs/long
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

from radarize.evaluation.evaluate import trajectory_errors
from radarize.evaluation.report.drawings import draw_doppler, draw_fan, draw_scan
from radarize.evaluation.report.page import COLORS
from radarize.io.recording import Recording
from radarize.pipeline.runfolder import RunFolder
from radarize.signal.heatmaps import Heatmaps
from radarsim.world.preview.figures import preview
from radarsim.world.scene import Scene

HERE = Path(__file__).parent / "pictures"


def heat_maps(recording: Path, seconds: float) -> plt.Figure:
    """One heat map of each kind with the true first surfaces and the true ridge."""
    with Recording(recording) as source:
        frame = int(np.searchsorted(source.times, seconds))
        adc = source.adc(frame, frame + 1)
        azimuths, scan = source.read("truth/scan_azimuths"), source.read("truth/scan")[frame]
        velocity = source.read("truth/velocity")[frame, :2]
        maps = Heatmaps(source.config)
    figure, axes = plt.subplots(1, 4, figsize=(17, 3), layout="constrained")
    fans = {
        "range-azimuth (Bartlett)": maps.range_azimuth(adc),
        "range-azimuth (Capon)": maps.range_azimuth(adc, method="capon"),
        "elevation-aware": maps.elevation_aware(adc),
    }
    for axis, (title, power) in zip(axes, fans.items(), strict=False):
        draw_fan(axis, power[0].numpy(), maps.ranges, maps.azimuths, title)
        draw_scan(axis, azimuths, scan, "truth", "true first surface")
    axes[0].legend(loc="lower left", fontsize=7)
    power = maps.doppler_azimuth(adc)[0].numpy()
    draw_doppler(axes[3], power, maps.velocities, maps.azimuths, "Doppler-azimuth", velocity)
    return figure


def trajectory_and_map(run: Path) -> plt.Figure:
    """Floor plan, map and trajectories from above; each trajectory is aligned by itself, as for its ATE."""
    folder = RunFolder(run)
    errors, scans = trajectory_errors(folder), folder.scans
    slam = errors["slam"]
    figure, axis = plt.subplots(figsize=(11, 7.2), layout="constrained")
    plan = scans["truth/floor_plan"]
    axis.plot(plan[:, [0, 2]].T, plan[:, [1, 3]].T, color="0.75", lw=0.8)
    axis.plot([], [], color="0.75", lw=1.5, label="true floor plan")
    grid = folder.map
    cells = grid.centers(grid.occupied)
    cells = np.column_stack([cells, np.zeros(len(cells))]) @ slam.turn.T + slam.shift
    axis.plot(cells[:, 0], cells[:, 1], "s", color=COLORS["map"], ms=1.6, label="map by SLAM (occupied cells)")
    for name, item, style in (("odometry", errors["odometry"], {"ls": "--", "lw": 1.3}), ("slam", slam, {"lw": 2.4})):
        path = item.estimate.positions_xyz
        title = f"{'SLAM' if name == 'slam' else name}: mean ATE {item.position.mean:.2f} m"
        axis.plot(path[:, 0], path[:, 1], color=COLORS[name], label=title, **style)
    truth = slam.reference.positions_xyz
    axis.plot(truth[:, 0], truth[:, 1], ":", color="k", lw=1.6, label="truth")
    axis.set(aspect="equal", xlabel="x, m", ylabel="y, m")
    axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.09), ncols=3, frameon=False, markerscale=4)
    return figure


def scenes() -> None:
    """Plans and renderings of the office, of the same one without clutter, and of a floor of each style."""
    bare = {"building": {"kind": "office", "seed": 7}, "clutter": 0, "unevenness": 0}
    drawn = [Scene.load(name) for name in ("office", *(f"buildings/{kind}" for kind in "abcd"))]
    for scene in (*drawn, Scene.of(bare, "office_bare")):
        for path in preview(scene, HERE, samples=64):
            small = Image.open(path).convert("RGB")
            small.thumbnail((900, 900))
            small.quantize(96).save(path, optimize=True)


def main() -> None:
    HERE.mkdir(exist_ok=True)
    scenes()
    if len(sys.argv) == 3:
        recording, run = map(Path, sys.argv[1:])
        heat_maps(recording, seconds=5.5).savefig(HERE / "heatmaps.png", dpi=70)
        plt.rcParams.update({"font.size": 13})
        trajectory_and_map(run).savefig(HERE / "run.png", dpi=75)


if __name__ == "__main__":
    main()
