"""`radarsim`: the simulator's command line. Heavy modules load inside the commands, so that --help is instant."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from radarize.console import keeping, new_app, progress, run, working
from radarize.errors import InputError

app = new_app("Ray-traced simulation of an IWR1843 radar in indoor scenes, as raw int16 I/Q.")
scene_app = typer.Typer(help="Look at a scene without simulating it.", no_args_is_help=True)
app.add_typer(scene_app, name="scene")

SceneName = Annotated[str, typer.Argument(metavar="SCENE", help="A scene of this project (office) or a .yaml file.")]


@app.command()
def simulate(
    scene: SceneName,
    output: Annotated[Path, typer.Option("--output", "-o", help="Recording to write (.h5).")],
    platform: Annotated[Literal["handheld", "cart", "robot"], typer.Option(help="How the sensor moves.")] = "handheld",
    trajectory: Annotated[Path | None, typer.Option(help="Poses (TUM) to follow instead of a platform's.")] = None,
    duration: Annotated[float, typer.Option(min=0.0, help="Length of the walk, s.")] = 40.0,
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same bytes.")] = 0,
    radar: Annotated[str, typer.Option(help="A .cfg file or a preset's name.")] = "radarize",
    device: Annotated[Literal["cpu", "cuda"], typer.Option(help="Where the echoes are summed.")] = "cpu",
):
    """Simulate a walk through SCENE and write it as a recording with its truth."""
    from radarsim.simulate import simulate

    with keeping(output), progress(f"simulate {Path(scene).stem}") as report:
        written = simulate(
            scene,
            output,
            platform=platform,
            trajectory=trajectory,
            duration=duration,
            seed=seed,
            radar=radar,
            device=device,
            progress=report,
        )
    print(written)


@scene_app.command()
def info(scene: SceneName):
    """Say what SCENE is made of."""
    from radarsim.scene.scene import Scene

    with working("loading the scene"):
        loaded = Scene.load(scene)
    print(loaded.info())


@scene_app.command()
def preview(
    scene: SceneName,
    output: Annotated[str, typer.Option("--output", "-o", help="Beginning of the pictures' names.")] = "",
):
    """Draw SCENE as pictures: its floor plan and a view into it."""
    from radarsim.scene.preview import preview
    from radarsim.scene.scene import Scene

    with working("drawing the scene"):
        pictures = preview(Scene.load(scene), output or Path(scene).stem)
    for picture in pictures:
        print(picture)


@app.command()
def export(
    recording: Annotated[Path, typer.Argument(metavar="REC.h5", help="Recording to convert.")],
    to: Annotated[Literal["dca1000", "tum"], typer.Option(help="Raw samples + .cfg, or the true poses.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="File to write (.bin or .tum).")],
):
    """Write a recording in another format."""
    from radarsim.export import export

    with working(f"exporting {recording.name}"):
        written = export(recording, to, output)
    print(written)


@app.command()
def doctor():
    """Say what is missing on this machine and how to get it."""
    from radarsim.doctor import examine

    if not examine():
        raise InputError("this machine cannot simulate yet; the lines above say what to type")


def main() -> None:
    """Entry point of the `radarsim` command."""
    run(app, "radarsim")


if __name__ == "__main__":
    main()
