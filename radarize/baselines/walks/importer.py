"""Import of a real walk of RadarHD's repository (`radarize.baselines.walks.walks`): radar pictures and lidar scans."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from radarize.baselines.walks.clock import Clock
from radarize.baselines.walks.poses import lidar_poses, stamps
from radarize.baselines.walks.walks import PERIOD, Walk
from radarize.io.errors import InputError
from radarize.io.importers.format import Format, Progress
from radarize.io.importers.parameters import Given
from radarize.io.recording import Product, RecordingWriter, Stream
from radarize.io.tum import planar_poses
from radarize.radar.presets import PRESETS
from radarize.signal import polar

#: Maximum time between radar and lidar pictures of equal frame index without a warning, s.
_MAX_OFFSET = 0.2


def import_walk(
    data: Path,
    number: int,
    output: Path,
    products: Mapping[str, Product],
    progress: Callable[[int, int], None] = lambda done, total: None,
    *,
    align: bool = False,
) -> Path:
    """Write a recording without samples: a radar picture per frame, with the lidar's pictures as truth.

    Args:
        data: folder ``dataset_5`` of a clone of the repository.
        number: number of the walk.
        output: recording to write.
        products: known poses; without them, poses are estimated by SLAM with the lidar's scans.
        progress: called with (steps done, steps in all).
        align: match the lidar's pictures by time instead of frame index (`radarize.baselines.walks.clock`), and leave
            out frames without a lidar picture of the same time.

    Raises:
        InputError: no such walk, or a picture that is missing, damaged, or of another size.
    """
    walk = Walk.find(data, number)
    times, total = stamps(walk.frames), 3 * walk.frames
    clock = Clock.of(walk, lambda done, _: progress(done, total))
    about = {"source": f"RadarHD walk {number} ({walk.folder.name})"}
    if align and not clock.estimated:
        about["warnings"] = (
            "--align: the clock could not be estimated, because the walk is too short or has no motion; radar and "
            "lidar are matched by frame index"
        )
    elif align:
        about["clock"] = f"truth of frame k is the lidar's picture {clock.first:.2f} + {clock.rate:.4f} k"
    elif (offset := max(map(abs, clock.late(walk.frames)))) > _MAX_OFFSET:
        about["warnings"] = (
            f"radar and lidar frames of equal index are up to {offset:.1f} s apart, so the truth belongs to other "
            "times: --align matches them by time"
        )
    if "truth/pose" not in products:
        about["found"] = "no poses were given: they were estimated by SLAM with the lidar's scans"
        poses = planar_poses(lidar_poses(walk, lambda done, _: progress(walk.frames + done, total)))
        products = {
            **products,
            "truth/time": Product(times, "s", "of poses"),
            "truth/pose": Product(poses, "m; x y z qx qy qz qw", "sensor in the lidar's map"),
        }
    if align:
        known = products["truth/time"]
        products = {**products, "truth/time": replace(known, data=PERIOD * clock.radar(known.data / PERIOD))}
    streams = {
        polar.PICTURE: Stream((polar.ROWS, polar.COLUMNS), "u1", "", "RadarHD's picture of one loop, 0...255"),
        "truth/scan": Stream((polar.BEAMS,), "f4", "m", "range of the lidar's first point, inf where it has none"),
        "truth/lidar": polar.LIDAR,
    }
    bearings = Product(polar.BEAM_AZIMUTHS, "rad", "bearings of /truth/scan, positive to the left")
    writer = RecordingWriter(
        output, PRESETS["radarhd"], attributes=about, streams=streams,
        products={"truth/scan_azimuths": bearings, **products}, raw=False,
    )  # fmt: skip
    partners = clock.partners(walk.frames) if align else np.arange(walk.frames)
    with writer:
        for frames, pictures in walk.batches():
            there = partners[frames] >= 0
            if there.any():
                lidar = np.stack([walk.lidar(partner) for partner in partners[frames][there].tolist()])
                first = np.where(lidar.any(axis=1), polar.RANGES[lidar.argmax(axis=1)], np.inf)
                rows = {polar.PICTURE: pictures[there], "truth/scan": first, "truth/lidar": np.packbits(lidar, axis=2)}
                writer.append(None, times[frames][there], rows=rows)
            progress(2 * walk.frames + frames.stop, total)
    return output


def _fits(source: Path) -> bool:
    return source.is_dir() and any((source / part / "radar").is_dir() for part in ("train", "test"))


def _write(source: Path, output: Path, given: Given, products: Mapping[str, Product], progress: Progress) -> Path:
    if given.walk is None:
        raise InputError(f"{source}: is a data set of walks, but --walk is missing, expected a number such as 227")
    return import_walk(source, given.walk, output, products, progress, align=given.align)


FORMAT = Format("data set of RadarHD's walks", "RadarHD's dataset_5", _fits, write=_write, options=("walk", "align"))
