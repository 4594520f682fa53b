"""Trajectories as TUM files and maps for ROS's map_server."""

from collections.abc import Callable
from pathlib import Path

from radarize.errors import InputError
from radarize.recording import Recording
from radarize.runfolder import RunFolder
from radarize.tum import write_tum


def export_tum(source: Path, output: Path, *, run: None, progress: Callable[[int, int], None]) -> Path:
    """Write the trajectory of a run, or the true poses of a recording as far as they are known.

    Raises:
        InputError: there is none, or the file cannot be written.
    """
    if source.is_dir():
        return write_tum(output, *RunFolder(source).trajectory)
    with Recording(source) as recording:
        if (truth := recording.true_poses()) is None:
            raise InputError(f"{source}: has no true poses (/truth/time and /truth/pose) to write as TUM")
    return write_tum(output, *truth)


def export_map(source: Path, output: Path, *, run: None, progress: Callable[[int, int], None]) -> Path:
    """Write a run's map as ``NAME.pgm`` and ``NAME.yaml``.

    Raises:
        InputError: `source` is no run with a map, or a file cannot be written.
    """
    if not source.is_dir():
        raise InputError(f"{source}: has no map, expected the folder of a run (radarize run {source} -o RUN)")
    found = RunFolder(source).map
    if found is None:
        raise InputError(f"{source}: has no map.yaml, expected a folder that radarize run wrote")
    stem = output.with_suffix("") if output.suffix in (".pgm", ".yaml") else output
    return found.save(stem.with_name(stem.name + ".yaml"))
