"""A real walk of RadarHD's repository (`radarize.walks`): pictures of a radar, and scans of the lidar beside it."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from radarize import polar
from radarize.errors import InputError
from radarize.radar.presets import PRESETS
from radarize.recording import Product, RecordingWriter, Stream
from radarize.tum import planar_poses
from radarize.walkposes import lidar_poses, stamps
from radarize.walks import Walk


def import_walk(
    data: Path,
    number: int,
    output: Path,
    products: dict[str, Product],
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Path:
    """Write a recording without samples: a picture a frame, and as truth what the lidar saw.

    Args:
        data: ``dataset_5`` of a user's clone.
        number: of the walk.
        output: recording to write.
        products: poses from elsewhere; by SLAM with the lidar's scans where there are none.
        progress: called with frames done and in all.

    Raises:
        InputError: no such walk, or a picture is missing, damaged, or of another size.
    """
    walk = Walk.find(data, number)
    times = stamps(walk.frames)
    streams = {
        polar.PICTURE: Stream((polar.ROWS, polar.COLUMNS), "u1", "", "RadarHD's picture of one loop, 0...255"),
        "truth/scan": Stream((polar.BEAMS,), "f4", "m", "range of the lidar's first point, inf where it has none"),
        "truth/lidar": polar.LIDAR,
    }
    bearings = Product(polar.BEAM_AZIMUTHS, "rad", "bearings of /truth/scan, positive to the left")
    about = {"source": f"RadarHD walk {number} ({walk.folder.name})"}
    if "truth/pose" not in products:
        about["found"] = "no poses were given: they are by SLAM with the lidar's scans"
        poses = planar_poses(lidar_poses(walk, lambda done, total: progress(done, 2 * total)))
        products = products | {
            "truth/time": Product(times, "s", "of poses"),
            "truth/pose": Product(poses, "m; x y z qx qy qz qw", "sensor in the lidar's map"),
        }
    writer = RecordingWriter(
        output, PRESETS["radarhd"], attributes=about, streams=streams,
        products={"truth/scan_azimuths": bearings, **products}, raw=False,
    )  # fmt: skip
    with writer:
        for frames, pictures in walk.batches():
            lidar = np.stack([walk.lidar(frame) for frame in range(frames.start, frames.stop)])
            first = np.where(lidar.any(axis=1), polar.RANGES[lidar.argmax(axis=1)], np.inf)
            rows = {polar.PICTURE: pictures, "truth/scan": first, "truth/lidar": np.packbits(lidar, axis=2)}
            writer.append(None, times[frames], rows=rows)
            progress(walk.frames + frames.stop, 2 * walk.frames)
    return output


def asked(source: Path, walk: int | None) -> bool:
    """Whether a source is such a data set.

    Raises:
        InputError: it is and no walk is named, or it is not and one is.
    """
    there = source.is_dir() and any((source / part / "radar").is_dir() for part in ("train", "test"))
    if there and walk is None:
        raise InputError(f"{source}: is a data set of walks, but --walk is missing, expected a number such as 227")
    if walk is not None and not there:
        raise InputError(f"{source}: holds no train/radar or test/radar, expected RadarHD's dataset_5 for walk {walk}")
    return there
