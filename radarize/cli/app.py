"""The command line itself, options that several commands have, and how they speak to the user."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from radarize.io.console import new_app
from radarize.io.plugins import Plugins

app = new_app("Radar-only indoor SLAM on raw I/Q of single-chip mmWave radars.")

RecordingFile = Annotated[Path, typer.Argument(metavar="REC.h5", help="A recording.")]
RunPath = Annotated[Path, typer.Argument(metavar="RUN", help="Folder that `radarize run` wrote.")]
Beside = Annotated[list[Path] | None, typer.Option(help="Another run of the same recording; may be repeated.")]
RadarFile = Annotated[str | None, typer.Option("--config", help="A .cfg or a preset's name.")]
BoardFile = Annotated[
    Path | None, typer.Option(metavar="BOARD.yaml", help="The board with its calibration, see `radarize calibrate`.")
]
PortName = Annotated[str | None, typer.Option("--port", help="The radar's serial command port.")]
Baud = Annotated[int, typer.Option(help="Of the command port.")]
Host = Annotated[str, typer.Option(help="This computer's address, which the DCA1000 sends to.")]
Dca = Annotated[str, typer.Option(help="The DCA1000's address.")]
CommandPort = Annotated[int, typer.Option(min=1, max=65535, help="UDP port of the DCA1000's commands.")]
DataPort = Annotated[int, typer.Option(min=1, max=65535, help="UDP port of its samples.")]
Duration = Annotated[float | None, typer.Option(min=0.0, help="End after so many seconds.")]
FrameCount = Annotated[int | None, typer.Option(min=1, help="End after so many frames.")]
Reading = Literal["corrected", "published"]
Overwrite = Annotated[
    bool, typer.Option("--overwrite", help="Replace a recording that came from a radar, or what was left of one.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]


def names(group: str) -> str:
    """Names of a group of entry points, for help."""
    return ", ".join(Plugins(group, group))


def warn(warnings: list[str]) -> None:
    for words in warnings:
        typer.echo(f"warning: {words}", err=True)


def damage(source: Path) -> list[str]:
    """Sentences on what of a recording is damaged, once all its samples have been unpacked; none of a run's folder."""
    from radarize.io.load import load

    if source.is_dir():
        return []
    with load(source) as recording:
        recording.valid(0, len(recording))
        return recording.damage


def tell(written: Path) -> None:
    """How many frames a new recording has, and what its attributes warn of."""
    from radarize.io.recording import Recording

    with Recording(written) as recording:
        for name in ("warnings", "assumed", "found"):
            if text := recording.attributes.get(name):
                typer.echo(f"{name}: {text}", err=True)
        print(f"{written}: {len(recording)} frames")
