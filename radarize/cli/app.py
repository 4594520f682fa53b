"""Application object of the command line, options shared by several commands, and their output of warnings."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from radarize.io.console import new_app
from radarize.io.plugins import Plugins

app = new_app("Radar-only indoor SLAM on raw I/Q of single-chip mmWave radars.")

RecordingFile = Annotated[Path, typer.Argument(metavar="REC.h5", help="Recording (HDF5).")]
RunPath = Annotated[Path, typer.Argument(metavar="RUN", help="Run folder, written by `radarize run`.")]
Beside = Annotated[
    list[Path] | None, typer.Option(help="Another run of the same recording to compare with; may be repeated.")
]
RadarFile = Annotated[str | None, typer.Option("--config", help="Radar configuration: a .cfg or the name of a preset.")]
BoardFile = Annotated[
    Path | None, typer.Option(metavar="BOARD.yaml", help="Board file with a calibration, see `radarize calibrate`.")
]
PortName = Annotated[str | None, typer.Option("--port", help="Serial command port of the radar.")]
Baud = Annotated[int, typer.Option(help="Baud rate of the command port.")]
Host = Annotated[str, typer.Option(help="IP address of this computer, to which the DCA1000 sends.")]
Dca = Annotated[str, typer.Option(help="IP address of the DCA1000.")]
CommandPort = Annotated[int, typer.Option(min=1, max=65535, help="UDP port of the DCA1000 for commands.")]
DataPort = Annotated[int, typer.Option(min=1, max=65535, help="UDP port to which the DCA1000 sends samples.")]
Duration = Annotated[float | None, typer.Option(min=0.0, help="Stop after this time, s.")]
FrameCount = Annotated[int | None, typer.Option(min=1, help="Stop after this number of frames.")]
Reading = Literal["corrected", "published"]
Overwrite = Annotated[
    bool,
    typer.Option("--overwrite", help="Replace an existing recording of a radar, or the rest of an interrupted one."),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]


def names(group: str) -> str:
    """Return the names in a group of entry points, separated by commas, for help texts."""
    return ", ".join(Plugins(group, group))


def warn(warnings: list[str]) -> None:
    """Print warnings to stderr."""
    for warning in warnings:
        typer.echo(f"warning: {warning}", err=True)


def damage(source: Path) -> list[str]:
    """Return a sentence on each damage of a recording, found by unpacking all its samples; empty for a run folder."""
    from radarize.io.load import load

    if source.is_dir():
        return []
    with load(source) as recording:
        recording.valid(0, len(recording))
        return recording.damage


def print_summary(written: Path) -> None:
    """Print the number of frames of a new recording, and the warnings in its attributes."""
    from radarize.io.recording import Recording

    with Recording(written) as recording:
        for name in ("warnings", "assumed", "found"):
            if text := recording.attributes.get(name):
                typer.echo(f"{name}: {text}", err=True)
        print(f"{written}: {len(recording)} frames")
