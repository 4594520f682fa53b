"""Trajectories as TUM files and maps for ROS's map_server."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import yaml

from radarize.errors import InputError
from radarize.recording import Recording
from radarize.replacing import replacing
from radarize.tum import read_tum, write_tum


def export_tum(source: Path, output: Path, *, run: None, progress: Callable[[int, int], None]) -> Path:
    """Write the trajectory of a run, or the true poses of a recording as far as they are known.

    Raises:
        InputError: there is none, or the file cannot be written.
    """
    if source.is_dir():
        return write_tum(output, *read_tum(source / "trajectory.tum"))
    with Recording(source) as recording:
        if not (recording.has("truth/time") and recording.has("truth/pose")):
            raise InputError(f"{source}: has no true poses (/truth/time and /truth/pose) to write as TUM")
        times, poses = recording.read("truth/time"), recording.read("truth/pose")
    shared = min(len(times), len(poses))
    known = np.isfinite(poses[:shared]).all(axis=1)
    return write_tum(output, times[:shared][known], poses[:shared][known])


def export_map(source: Path, output: Path, *, run: None, progress: Callable[[int, int], None]) -> Path:
    """Write a run's map as ``NAME.pgm`` and ``NAME.yaml``.

    Raises:
        InputError: `source` is no run with a map, or a file cannot be written.
    """
    from radarize.evaluation.runfiles import read_map

    if not source.is_dir():
        raise InputError(f"{source}: has no map, expected the folder of a run (radarize run {source} -o RUN)")
    description = source / "map.yaml"
    read_map(description)
    fields = yaml.safe_load(description.read_text())
    stem = output.with_suffix("") if output.suffix in (".pgm", ".yaml") else output
    image = stem.with_name(stem.name + ".pgm")
    with replacing(image) as part:
        part.write_bytes((description.parent / fields["image"]).read_bytes())
    with replacing(stem.with_name(stem.name + ".yaml")) as part:
        part.write_text(yaml.safe_dump({**fields, "image": image.name}, sort_keys=False))
    return stem.with_name(stem.name + ".yaml")
