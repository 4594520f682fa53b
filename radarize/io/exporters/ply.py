"""Export of points as PLY, for MeshLab, CloudCompare, Open3D and others: points of a recording, or scans of a run."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Float, Num
from scipy.spatial.transform import Rotation, Slerp

from radarize.io.errors import InputError
from radarize.io.pose import transform
from radarize.io.recording import Recording
from radarize.io.replacing import replacing
from radarize.io.tum import planar
from radarize.pipeline.runfolder import RunFolder
from radarize.signal.points import COLUMNS, PointClouds

_KINDS = {"f8": "double", "f4": "float", "i4": "int"}


def export_ply(source: Path, output: Path, *, progress: Callable[[int, int], None]) -> Path:
    """Write ``NAME.ply``, binary, with a vertex per point: x, y, z (m), time (s), frame; for a recording also velocity
    (m/s, closing positive), snr and noise (dB).

    Points of a recording are the stored ones, or else those that the radar's firmware would detect. They are in the
    world frame if true poses are known, else in the sensor frame. Scans of a run are in the frame of its map.

    Raises:
        InputError: a run without scans, or the file cannot be written.
    """
    output = output if output.suffix == ".ply" else output.with_name(output.name + ".ply")
    if source.is_dir():
        return write_ply(output, *_scans(RunFolder(source)), comment="scans in the map of a run")
    with Recording(source) as recording:
        columns, where = _points(recording, progress)
    return write_ply(output, *columns, comment=where)


def write_ply(
    path: Path, xyz: Float[np.ndarray, "point 3"], fields: Mapping[str, Num[np.ndarray, "point"]], comment: str = ""
) -> Path:
    """Write points as a binary little-endian PLY file.

    Args:
        path: file to write.
        xyz: positions, m.
        fields: further values per point, float64, float32 or int32, by name.

    Raises:
        InputError: it cannot be written.
    """
    columns = {**dict(zip("xyz", xyz.astype("<f4").T, strict=True)), **fields}
    kind = np.dtype([(name, values.dtype.newbyteorder("<")) for name, values in columns.items()])
    table = np.empty(len(xyz), kind)
    for name, values in columns.items():
        table[name] = values
    properties = [f"property {_KINDS[values.dtype.str[1:]]} {name}" for name, values in columns.items()]
    lines = ["ply", "format binary_little_endian 1.0", f"comment {comment}", f"element vertex {len(xyz)}", *properties]
    with replacing(path) as part:
        part.write_bytes("\n".join([*lines, "end_header", ""]).encode() + table.tobytes())
    return path


def _scans(run: RunFolder) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return the end points of scan beams, placed by the poses of the trajectory."""
    if not run.scans:
        raise InputError(f"{run.path}: has no scans.h5, expected a run with scans")
    times, slam = run.trajectory
    stamps, ranges, azimuths = (run.scans[name].astype(float) for name in ("time", "ranges", "azimuths"))
    after = np.searchsorted(times, stamps).clip(1, max(1, len(times) - 1))
    nearest = np.where(stamps - times[after - 1] < times[after] - stamps, after - 1, after) if len(times) > 1 else 0
    poses = np.broadcast_to(planar(slam)[nearest], (len(stamps), 3))
    scan, beam = np.nonzero(np.isfinite(ranges) & (ranges > 0))
    found = ranges[scan, beam]
    ends = np.stack([found * np.cos(azimuths[beam]), found * np.sin(azimuths[beam])], axis=1)
    placed = np.concatenate([transform(poses[k], ends[scan == k]) for k in np.unique(scan)] or [np.zeros((0, 2))])
    xyz = np.column_stack([placed, np.zeros(len(placed))])
    return xyz, {"time": stamps[scan], "frame": scan.astype(np.int32)}


def _points(
    recording: Recording, progress: Callable[[int, int], None]
) -> tuple[tuple[np.ndarray, dict[str, np.ndarray]], str]:
    """Return the points of all frames, and their frame of reference."""
    stored = recording.has("points/frame") and recording.has("points/cloud")
    maker = None if stored else PointClouds(recording.config)
    clouds = []
    for k in range(len(recording)):
        cloud = recording.rows("points/cloud", k, k + 1) if maker is None else maker(recording.adc(k, k + 1))[0]
        clouds.append(np.column_stack([cloud, np.full(len(cloud), k)]))
        progress(k + 1, len(recording))
    table = np.concatenate([*clouds, np.zeros((0, len(COLUMNS) + 1))]).astype(float)
    frame, xyz, where = table[:, -1].astype(np.int32), table[:, :3], "points in the frame of the sensor"
    times = (recording.times + recording.config.burst_center)[frame]
    truth = recording.true_poses()
    if truth is not None and len(truth[0]) > 1:
        known = (times >= truth[0][0] - 1e-6) & (times <= truth[0][-1] + 1e-6)
        table, frame, xyz, times = table[known], frame[known], xyz[known], times[known]
        at = times.clip(truth[0][0], truth[0][-1])
        turn = Slerp(truth[0], Rotation.from_quat(truth[1][:, 3:]))(at)
        place = np.column_stack([np.interp(at, truth[0], column) for column in truth[1][:, :3].T])
        xyz, where = place + turn.apply(xyz), "points in the world, by true poses"
    others = {name: table[:, 3 + k].astype(np.float32) for k, name in enumerate(COLUMNS[3:])}
    return (xyz, {"time": times, "frame": frame, **others}), where
