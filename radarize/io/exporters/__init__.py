"""Export of recordings and runs to formats of other programs, one module per format."""

import inspect
from collections.abc import Callable
from pathlib import Path

from radarize.io.errors import InputError
from radarize.io.plugins import Plugins

#: Formats by name: entry points of the group ``radarize.exporters``, functions such as `plain.export_tum` of source and
#: output, with the keywords progress and those of `run`, `iq_order` and `time_offset` that the format has.
FORMATS: Plugins[Callable[..., Path]] = Plugins("radarize.exporters", "export format")


def export(
    source: Path,
    format: str,
    output: Path,
    *,
    run: Path | None = None,
    iq_order: str | None = None,
    time_offset: float | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Path:
    """Write a recording or a run in another format.

    Args:
        source: a recording (``.h5``), or the folder of a run.
        format: ``bin``: raw samples and ``.cfg`` of a recording, as an IWR1843 with a DCA1000 leaves them; ``ros2``: a
            ROS 2 bag, see `radarize.io.exporters.ros2`; ``radarize-ae``: a ROS 1 bag for the paper's published code,
            see `radarize.io.exporters.radarize_ae`; ``roverd``: a sequence for roverd and nrdk, see
            `radarize.io.exporters.roverd`; ``tum``: the trajectory of a run, or a recording's true poses; ``ply``: the
            points of a recording, or the scans of a run; ``map``: a run's map for ROS's map_server.
        output: file or, for ``ros2`` and ``roverd``, folder to write.
        run: of ``ros2``: folder of the run that `source`, a recording, was put through; its scans and odometry go into
            the bag.
        iq_order: of ``bin``: order of I and Q in the file, ``iiqq`` (mmWave Studio) or ``qqii`` (SDK demo); the
            recording's own if None.
        time_offset: of bags: s, added to all stamps; if None, 1,700,000,000 where they begin within a day of zero, as
            a simulator's do, else nothing.
        progress: called with frames done and in all.

    Returns:
        The file or folder that was written.

    Raises:
        InputError: unknown format, an option that it has not, the source lacks what is asked for, or the output cannot
            be written.

    Example:
        >>> export(Path("walk.h5"), "ply", Path("points.ply"))
    """
    writer = FORMATS.find(format)
    options = {"run": run, "iq_order": iq_order, "time_offset": time_offset}
    given = {name: value for name, value in options.items() if value is not None}
    for name in given.keys() - inspect.signature(writer).parameters.keys():
        able = ", ".join(each for each, other in FORMATS.items() if name in inspect.signature(other).parameters)
        raise InputError(f"export format is {format}, but {name} is given, expected that of {able} only")
    return writer(Path(source), Path(output), progress=progress, **given)
