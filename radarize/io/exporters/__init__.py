"""Recordings and runs as files for other programs, one module per format."""

from collections.abc import Callable
from pathlib import Path

from radarize.io.errors import InputError
from radarize.io.plugins import Plugins

#: Formats by name: entry points of the group ``radarize.exporters``, functions such as `plain.export_tum`.
FORMATS: Plugins[Callable[..., Path]] = Plugins("radarize.exporters", "export format")


def export(
    source: Path,
    format: str,
    output: Path,
    *,
    run: Path | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Path:
    """Write a recording or a run in another format.

    Args:
        source: a recording (``.h5``), or the folder of a run.
        format: ``bin``: raw samples and ``.cfg`` of a recording, as an IWR1843 with a DCA1000 leaves them; ``ros2``: a
            ROS 2 bag, see `radarize.io.exporters.ros2`; ``tum``: the trajectory of a run, or a recording's true poses;
            ``map``: a run's map for ROS's map_server.
        output: file or, for ``ros2``, folder to write.
        run: folder of the run that `source`, a recording, was put through; its scans and odometry go into the bag.
        progress: called with frames done and in all.

    Raises:
        InputError: unknown format, the source lacks what is asked for, or the output cannot be written.
    """
    writer = FORMATS.find(format)
    if run is not None and format != "ros2":
        raise InputError(f"export format is {format}, but a run is given beside the source, expected that of ros2 only")
    return writer(Path(source), Path(output), run=run, progress=progress)
