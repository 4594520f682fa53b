"""A recording, a run, or both in the Rerun viewer, on a time line in seconds since the first frame.

    /world                  z up; /floor_plan
    /world/truth            path; radar (pose), below it scan, points (TI's), camera/depth
    /world/slam             path, map; radar, below it scan: all aligned with the truth, if there is one
    /world/odometry         path; radar
    /radar                  range_azimuth and doppler_azimuth (left is left, far is up), cause (path type of every cell)
    /velocity               forward and left, of truth and run

Data is sent column-wise, in batches of frames.
"""

import os
import sys
import sysconfig
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, Shaped

from radarize.evaluation.evaluate import trajectories
from radarize.evaluation.report.page import COLORS
from radarize.evaluation.shownmaps import MAPS, ShownMaps
from radarize.io.alignment import fitted, trajectory
from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.io.replacing import replacing
from radarize.pipeline.runfolder import RunFolder
from radarize.pipeline.runfolder.occupancy import OccupancyMap

if TYPE_CHECKING:  # an extra
    import rerun
    import rerun.blueprint

_BATCH = 16
#: Colours of path types in the order of their labels: direct, floor or ceiling, then the others.
PATH_TYPE_COLORS = ("#39d0d8", "#8b949e", "#e4572e", "#f2703a", "#f2a33a", "#9a6fd0", "#2e9e6b", "#5c6570")


def view(
    source: Path,
    run: Path | None = None,
    save: Path | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Path | None:
    """Show a recording or a run.

    Args:
        source: a recording (``.h5``), or the folder of a run.
        run: run of the recording, to show with it.
        save: file to write (``.rrd``) instead of opening a window.
        progress: called with (frames done, frames in all).

    Raises:
        InputError: unusable source, the file cannot be written, or there is no screen for a window.
    """
    import rerun

    with opened(source, run) as (recording, folder):
        stream = rerun.RecordingStream("radarize", recording_id=str(Path(source).resolve()))
        with replacing(save) if save else nullcontext() as part:
            if part:
                stream.save(part, default_blueprint=_layout())
            else:
                _open_window(stream)
            screen = Screen(stream)
            if recording is not None:
                screen.start = float(recording.times[0])
            if folder is not None:
                show_run(screen, folder)
            if recording is not None:
                show_recording(screen, recording, progress)
            stream.flush()
            stream.disconnect()
    return Path(save) if save else None


def _open_window(stream: "rerun.RecordingStream") -> None:
    """Start the viewer, searching the programs of this Python environment as well."""
    if sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys():
        raise InputError("a window needs a screen, but DISPLAY and WAYLAND_DISPLAY are not set; --save writes a file")
    os.environ["PATH"] = os.pathsep.join([os.environ.get("PATH", os.defpath), sysconfig.get_path("scripts")])
    stream.spawn(default_blueprint=_layout())


@contextmanager
def opened(source: Path, run: Path | None) -> Iterator[tuple[Recording | None, RunFolder | None]]:
    """Open a recording and its run, or one of them.

    Raises:
        InputError: two runs, a recording without a frame, or see `Recording` and `RunFolder`.
    """
    source = Path(source)
    if source.is_dir():
        if run is not None:
            raise InputError(f"{source} is a run, and --run {run} another, expected a recording with --run")
        yield None, RunFolder(source)
        return
    with Recording(source) as recording:
        if not len(recording):
            raise InputError(f"{source}: has no whole frame, expected at least one")
        yield recording, None if run is None else RunFolder(run)


def _layout() -> "rerun.blueprint.Blueprint":
    """Return the layout of the window."""
    import rerun.blueprint as rrb

    pictures = [rrb.Spatial2DView(origin=f"radar/{name}", name=name.replace("_", "-")) for name in (*MAPS, "cause")]
    depth = rrb.Spatial2DView(origin="world/truth/radar/camera/depth", name="depth")
    speeds = [rrb.TimeSeriesView(origin=f"velocity/{axis}", name=f"{axis}, m/s") for axis in ("forward", "left")]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.Spatial3DView(origin="world", name="map"), rrb.Horizontal(*speeds), row_shares=[3, 1]
            ),
            rrb.Grid(*pictures, depth, grid_columns=2),
            column_shares=[3, 2],
        ),
        collapse_panels=True,
    )  # fmt: skip


class Screen:
    """Sender to a Rerun stream, column-wise.

    Attributes:
        start: time stamp of the zero of the time line, s.
    """

    def __init__(self, stream: "rerun.RecordingStream"):
        import rerun

        self.rr, self._stream, self.start = rerun, stream, 0.0
        self._styled: set[str] = set()

    def fixed(self, path: str, *things: "rerun.AsComponents") -> None:
        """Send static data."""
        self._stream.log(path, *things, static=True)

    def style(self, path: str, thing: "rerun.AsComponents") -> None:
        """Send properties that all rows of a path share, once."""
        if path not in self._styled:
            self._styled.add(path)
            self.fixed(path, thing)

    def over_time(self, path: str, times: Float[np.ndarray, "row"], columns: "rerun.ComponentColumnList") -> None:
        """Send data with time stamps (s)."""
        clock = self.rr.TimeColumn("time", duration=np.asarray(times) - self.start)
        self._stream.send_columns(path, indexes=[clock], columns=columns)

    def line(self, path: str, points: Float[np.ndarray, "point 3"], color: str) -> None:
        """Send a line through points (m)."""
        self.fixed(path, self.rr.LineStrips3D([points], colors=_rgb(color), radii=0.015))

    def poses(self, path: str, times: Float[np.ndarray, "row"], poses: Float[np.ndarray, "row 7"]) -> None:
        """Send a moving frame, with axes half a metre long."""
        self.over_time(path, times, self.rr.Transform3D.columns(translation=poses[:, :3], quaternion=poses[:, 3:]))
        self.fixed(path, self.rr.TransformAxes3D(axis_length=0.5))

    def points(
        self, path: str, times: Float[np.ndarray, "row"], clouds: list[Float[np.ndarray, "point 3"]], color: str
    ) -> None:
        """Send a point cloud for every time, in the frame of the path's parent."""
        columns = self.rr.Points3D.columns(positions=np.concatenate(clouds))
        self.over_time(path, times, columns.partition([len(cloud) for cloud in clouds]))
        self.style(path, self.rr.Points3D.from_fields(radii=0.03, colors=_rgb(color)))

    def scans(
        self,
        path: str,
        times: Float[np.ndarray, "row"],
        azimuths: Float[np.ndarray, "beam"],
        ranges: Float[np.ndarray, "row beam"],
        color: str,
    ) -> None:
        """Send the end points of beams with a return."""
        clouds = []
        for row in ranges:
            hit = np.isfinite(row) & (row > 0)
            x, y = row[hit] * np.cos(azimuths[hit]), row[hit] * np.sin(azimuths[hit])
            clouds.append(np.column_stack([x, y, np.zeros_like(x)]))
        self.points(path, times, clouds, color)

    def pictures(
        self,
        path: str,
        times: Float[np.ndarray, "row"],
        images: Shaped[np.ndarray, "row height width *channel"],
        kind: Any,
        **more: Any,
    ) -> None:
        """Send images of one format: `kind` is Image (RGB), SegmentationImage or DepthImage; `more` are its fields."""
        shape, rr = images.shape[1:], self.rr
        model = {"color_model": "RGB"} if len(shape) == 3 else {"color_model": "L"}
        form = rr.components.ImageFormat(
            width=shape[1], height=shape[0], channel_datatype=f"U{8 * images.itemsize}", **model
        )
        self.style(path, kind.from_fields(format=form, **more))
        self.over_time(path, times, kind.columns(buffer=[image.tobytes() for image in images]))

    def speeds(self, times: Float[np.ndarray, "row"], velocity: Float[np.ndarray, "row 2"], who: str) -> None:
        """Send velocities forward and left, m/s."""
        for axis, column in zip(("forward", "left"), velocity.T, strict=True):
            known = np.isfinite(column)
            self.over_time(f"velocity/{axis}/{who}", times[known], self.rr.Scalars.columns(scalars=column[known]))


def show_recording(screen: Screen, recording: Recording, progress: Callable[[int, int], None]) -> None:
    """Send the heat maps of a recording, and its truth and other sensors."""
    rr, config = screen.rr, recording.config
    screen.fixed("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    if recording.has("truth/floor_plan"):
        ends = recording.read("truth/floor_plan").reshape(-1, 2, 2)
        walls = np.concatenate([ends, np.zeros((len(ends), 2, 1))], axis=2)
        screen.fixed("world/floor_plan", rr.LineStrips3D(walls, colors=_rgb(COLORS["truth"]), radii=0.01))
    if truth := recording.true_poses():
        screen.line("world/truth/path", truth[1][:, :3], COLORS["good"])
        screen.poses("world/truth/radar", *truth)
    if recording.has("truth/velocity"):
        speeds = recording.rows("truth/velocity", 0, len(recording))[:, :2]
        screen.speeds(recording.times + config.burst_center, speeds, "truth")
    if recording.has("truth/cause"):
        names = recording.labels("truth/cause")
        labels = [(k, name, _rgb(PATH_TYPE_COLORS[k % len(PATH_TYPE_COLORS)])) for k, name in enumerate(names)]
        screen.fixed("radar/cause", rr.AnnotationContext([*labels, (255, "noise", (0, 0, 0))]))
    if recording.has("truth/depth_mount") and recording.has("truth/depth_intrinsics"):
        _send_camera(screen, recording)
    maps = ShownMaps(recording)
    for first in range(0, len(recording), _BATCH):
        last = min(first + _BATCH, len(recording))
        _send_frames(screen, recording, first, last, maps)
        progress(last, len(recording))


def _send_camera(screen: Screen, recording: Recording) -> None:
    """Send the mounting of the depth camera and its intrinsics."""
    rr, mount = screen.rr, recording.read("truth/depth_mount")
    fx, fy, cx, cy = map(float, recording.read("truth/depth_intrinsics"))
    shape = recording.describe("truth/depth")["shape"]
    assert isinstance(shape, tuple)
    height, width = shape[1:]
    place = rr.Transform3D(translation=mount[:3], quaternion=rr.Quaternion(xyzw=mount[3:]))
    screen.fixed("world/truth/radar/camera", place)
    lens = rr.Pinhole(
        focal_length=[fx, fy], principal_point=[cx, cy], resolution=[width, height],
        camera_xyz=rr.ViewCoordinates.RDF, image_plane_distance=0.3,
    )  # fmt: skip
    # The axes of the camera are right, down, forward.
    turn = rr.Transform3D(quaternion=rr.Quaternion(xyzw=[-0.5, 0.5, -0.5, 0.5]))
    screen.fixed("world/truth/radar/camera/depth", turn, lens)


def _send_frames(screen: Screen, recording: Recording, first: int, last: int, maps: ShownMaps) -> None:
    """Send frames first...last-1; the time of all streams is the middle of the burst."""
    rr, times = screen.rr, recording.times[first:last] + recording.config.burst_center
    for name, pixels in maps.of(first, last).items():
        screen.pictures(f"radar/{name}", times, pixels, rr.Image)
    if recording.has("truth/cause"):
        cause = recording.rows("truth/cause", first, last)[:, ::-1, ::-1]
        screen.pictures("radar/cause", times, cause, rr.SegmentationImage)
    if recording.has("truth/scan"):
        scans, azimuths = recording.rows("truth/scan", first, last), recording.read("truth/scan_azimuths")
        screen.scans("world/truth/radar/scan", times, azimuths, scans, COLORS["truth"])
    if recording.has("points/cloud"):
        clouds = [recording.rows("points/cloud", k, k + 1)[:, :3] for k in range(first, last)]
        screen.points("world/truth/radar/points", times, clouds, COLORS["map"])
    if recording.has("truth/depth"):
        path, depth = "world/truth/radar/camera/depth", recording.rows("truth/depth", first, last)
        screen.pictures(path, times, depth, rr.DepthImage, meter=1000.0, colormap="viridis")


def _rgb(color: str) -> tuple[int, int, int]:
    """Convert #rrggbb to red, green, blue."""
    red, green, blue = bytes.fromhex(color[1:])
    return red, green, blue


def show_run(screen: Screen, run: RunFolder) -> None:
    """Send the trajectories of a run, aligned with the truth if there is one, its map and its scans."""
    rr = screen.rr
    scans, paths = run.scans, trajectories(run)
    reference = None if run.reference is None else trajectory(*run.reference)
    screen.start = screen.start or float(paths["slam"].timestamps[0])
    screen.fixed("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    for name, path in paths.items():
        if reference is not None:
            turn, shift = fitted(path, reference)
            # The plane of SLAM is at the mean height of the radar.
            shift = shift + [0, 0, reference.positions_xyz[:, 2].mean()]
            screen.fixed(f"world/{name}", rr.Transform3D(translation=shift, mat3x3=turn))
        poses = np.hstack([path.positions_xyz, np.roll(path.orientations_quat_wxyz, -1, axis=1)])
        screen.line(f"world/{name}/path", path.positions_xyz, COLORS[name])
        screen.poses(f"world/{name}/radar", path.timestamps, poses)
    if scans:
        screen.scans("world/slam/radar/scan", scans["time"], scans["azimuths"], scans["ranges"], COLORS["slam"])
    if "velocity" in scans:
        screen.speeds(scans["time"], scans["velocity"], "run")
    if run.map is not None:
        _send_map(screen, run.map)


def _send_map(screen: Screen, found: OccupancyMap) -> None:
    """Send the map as an image on the ground of SLAM's frame."""
    rr, (height, width) = screen.rr, found.pixels.shape
    x, y, yaw = found.origin
    form = rr.components.ImageFormat(width=width, height=height, color_model="L", channel_datatype="U8")
    screen.fixed(
        "world/slam/map",
        rr.GridMap(
            data=found.pixels.tobytes(), format=form, cell_size=found.resolution, translation=[x, y, -0.01],
            rotation_axis_angle=rr.RotationAxisAngle([0, 0, 1], yaw), opacity=0.8, colormap="grayscale",
        ),
    )  # fmt: skip
