"""Command line of the simulator, `radarsim`. Heavy modules are imported inside the commands, so that --help is fast."""

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from radarize.io.console import new_app, print_table, progress, run, working
from radarize.io.errors import InputError
from radarize.io.plugins import Plugins

app = new_app("Ray-traced simulation of TI mmWave radars in indoor scenes, as raw int16 I/Q.")
scene_app = typer.Typer(help="Show, import and export scenes.", no_args_is_help=True)
app.add_typer(scene_app, name="scene")

SceneName = Annotated[
    str, typer.Argument(metavar="SCENE", help="Scene: a name (office, stress/corner@2) or a YAML file.")
]


def _pose(about: str) -> Any:
    return typer.Option(metavar="'X Y Z ROLL PITCH YAW'", help=about)


def _print_warnings(attributes: dict[str, object]) -> None:
    if attributes["warnings"]:
        print(f"warning: {attributes['warnings']}")


@app.command()
def simulate(
    scene: SceneName,
    output: Annotated[Path, typer.Option("--output", "-o", help="Recording to write (.h5).")],
    platform: Annotated[Literal["handheld", "cart", "robot"], typer.Option(help="Carrier of the sensor.")] = "handheld",
    trajectory: Annotated[Path | None, typer.Option(help="Poses (TUM) to follow instead of a tour.")] = None,
    waypoints: Annotated[
        Path | None, typer.Option(help="Way-points x y in m instead of a tour (YAML, CSV, TUM).")
    ] = None,
    mounting: Annotated[str, _pose("Mounting of the sensor on its platform, m and degrees.")] = "",
    duration: Annotated[
        float | None, typer.Option(min=0.0, help="Duration, s; default: 40 s of a tour, or all of the given path.")
    ] = None,
    people: Annotated[int, typer.Option(min=0, max=50, help="Number of pedestrians near the radar's path.")] = 0,
    seed: Annotated[int, typer.Option(min=0, help="Random seed; the same seed gives the same bytes.")] = 0,
    radar: Annotated[str, typer.Option(help="Radar configuration: a .cfg file or a preset.")] = "radarize",
    frontend: Annotated[
        Path | None, typer.Option(help="Front-end file (.yaml) of `calibrate`; default: the board's.")
    ] = None,
    sensors: Annotated[
        str,
        typer.Option(
            help="Sensors and truth to add, comma-separated: depth, occupancy, tracking, imu, points, ghosts, or all; "
            "also paths (all paths above the noise) and adc-by-cause (noise-free I/Q by path type; much larger files)."
        ),
    ] = "",
    workers: Annotated[
        int | None, typer.Option(min=1, help="Number of processes; default: one per core, fewer if short.")
    ] = None,
) -> None:
    """Simulate a walk through SCENE and write a recording with ground truth; an interrupted run is resumed."""
    plan: Any = {name: value for name, value in locals().items() if name not in ("scene", "output")}
    from radarize.io.recording import keeping
    from radarize.radar.cfg import remarks
    from radarsim.api import simulate
    from radarsim.motion.statistics import Statistics

    with keeping(output), progress(f"simulate {Path(scene).stem}") as report:
        recording = simulate(scene, output, progress=report, **plan)
    for words in remarks(recording.cfg_text, recording.config):
        print(f"warning: {words}")
    print(Statistics.from_json(str(recording.attributes["motion"])))
    _print_warnings(recording.attributes)
    print(output)


@app.command()
def dataset(
    specification: Annotated[
        Path, typer.Argument(metavar="SPEC.yaml", help="Data set: a file, or small, training, evaluation, stress, ...")
    ],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Folder for the recordings.")] = None,
    plan: Annotated[bool, typer.Option("--plan", help="Print the parameters of each recording and stop.")] = False,
    workers: Annotated[int | None, typer.Option(min=1, help="Number of processes; default: one per core.")] = None,
    ray: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Ray cluster; auto: on this machine.")] = None,
    replace: Annotated[bool, typer.Option("--replace", help="Replace recordings with other parameters.")] = False,
) -> None:
    """Simulate the recordings of a data set; an interrupted run is resumed."""
    from radarsim.dataset.plan import print_plan
    from radarsim.dataset.run import make
    from radarsim.dataset.specification import Specification

    wanted = Specification.load(specification)
    if plan:
        print_plan(wanted)
        return
    if output is None:
        raise InputError("--output is missing, expected a folder for the recordings, or --plan")
    with progress("frames") as report:
        outcome = make(wanted, output, workers=workers, ray=ray, replace=replace, progress=report)
    print(f"{len(outcome.made)} recordings made, {len(outcome.kept)} already there; {output}")
    if outcome.failed:
        raise InputError(f"{len(outcome.failed)} recordings failed: {'; '.join(outcome.failed.values())}")


@app.command()
def calibrate(
    recording: Annotated[Path, typer.Argument(metavar="REAL.h5", help="Recording of a real radar, best at rest.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Front-end file to write (.yaml).")],
    frames: Annotated[int, typer.Option(min=1, help="Number of frames to use.")] = 8,
) -> None:
    """Fit the simulated front end to a real radar: noise, filter band edge, leakage, channel errors."""
    from radarsim.receiver.calibrate import calibrate

    with working(f"calibrating on {recording.name}"):
        found = calibrate(recording, output, frames)
    for remark in found.remarks:
        print(remark)
    print(output)


@app.command()
def twin(
    recording: Annotated[Path, typer.Argument(metavar="REAL.h5", help="Recording of a real radar with poses.")],
    scene: Annotated[str, typer.Option(help="Model of the place: a scene's name or YAML file.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Recording to write (.h5), with a report beside.")],
    origin: Annotated[str, _pose("Origin of the poses in the scene, m and degrees.")] = "",
    mounting: Annotated[str, _pose("Mounting of the radar on the body that the poses describe.")] = "",
    at: Annotated[str, _pose("Pose of a radar at rest, if the recording has none.")] = "",
    frontend: Annotated[Path | None, typer.Option(help="Front-end file (.yaml); default: the board's.")] = None,
    calibrate: Annotated[
        bool, typer.Option("--calibrate", help="Fit the front end to the recording first; also writes its .yaml.")
    ] = False,
    every: Annotated[int, typer.Option(min=1, help="Simulate every N-th frame.")] = 1,
    duration: Annotated[float | None, typer.Option(min=0.0, help="Duration, s; default: all of it.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Random seed of speckle and noise.")] = 0,
) -> None:
    """Simulate a real recording again in a model of its place, frame by frame, and compare the two."""
    from radarize.io.recording import Recording, keeping
    from radarsim.motion.trajectory import Mounting
    from radarsim.twin.report import report_twin
    from radarsim.twin.twin import Options, make_twin

    start, mount, rest = (Mounting.parse(text) if text else None for text in (origin, mounting, at))
    with keeping(output), progress("twin") as report:
        made = make_twin(
            recording, scene, output,
            Options(start, mount, rest, frontend, calibrate, every, duration, seed),
            progress=lambda *done: report("simulate", *done),
        )  # fmt: skip
        page, sentences = report_twin(recording, made, progress=lambda *done: report("compare", *done))
    with Recording(made) as twin_of:
        _print_warnings(twin_of.attributes)
    print("\n".join(sentences))
    for path in (made, page, page.with_suffix(".json")):
        print(path)


@scene_app.command()
def info(scene: SceneName) -> None:
    """Print extent, objects, materials, clutter and unevenness of SCENE."""
    from radarsim.world.scene import Scene
    from radarsim.world.surface_settings import IDEAL

    with working("loading the scene"):
        loaded = Scene.load(scene)
    low, high = loaded.bounds
    print(f"{loaded.name}: {len(loaded.objects)} objects, {len(loaded.triangles)} triangles")
    for axis, start, end in zip("xyz", low, high, strict=True):
        print(f"  {axis}: {start:.2f} to {end:.2f} m")
    rows = []
    for name in sorted({item.material.name for item in loaded.objects}):
        meshes = [item.mesh for item in loaded.objects if item.material.name == name]
        area = sum(mesh.area for mesh in meshes)
        rows.append((name, len(meshes), sum(len(mesh.faces) for mesh in meshes), f"{area:.2f}"))
    print_table(("material", "objects", "triangles", "area, m2"), rows, numbers=(1, 2, 3))
    settings = loaded.surface_settings
    print(f"clutter: {settings.clutter:g}, unevenness: {settings.unevenness:g}")
    if settings == IDEAL:
        print("This scene has no clutter. To add some: `clutter: 1` and `unevenness: 1`.")


@scene_app.command()
def preview(
    scene: SceneName,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the pictures.")] = Path("."),
    web: Annotated[bool, typer.Option("--web", help="Write an interactive 3-D page instead.")] = False,
    time: Annotated[float, typer.Option(min=0.0, help="Time of the frame whose paths the page shows, s.")] = 0.0,
    seed: Annotated[int, typer.Option(min=0, help="Random seed of the page's tour.")] = 0,
) -> None:
    """Draw SCENE: its floor plan, and a rendering without the ceilings."""
    from radarsim.world.scene import Scene

    if web:
        from radarsim.webpreview import web_preview

        with working("drawing the scene"):
            loaded = Scene.load(scene)
            print(web_preview(loaded, output / f"{loaded.name}.html", time=time, seed=seed))
        return
    from radarsim.world.preview.figures import preview

    with working("drawing the scene"):
        pictures = preview(Scene.load(scene), output)
    for picture in pictures:
        print(picture)


@scene_app.command("export")
def export_(
    scene: SceneName,
    output: Annotated[Path, typer.Option("--output", "-o", help="Mesh file to write: .glb, .ply, .obj or .stl.")],
) -> None:
    """Export SCENE as a mesh in m, z up (glTF: y up)."""
    from radarsim.world.export import export_scene
    from radarsim.world.scene import Scene

    with working("writing the scene"):
        print(export_scene(Scene.load(scene), output))


@scene_app.command("import")
def import_(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="A mesh (.glb .gltf .obj .ply .stl), a Mitsuba or Sionna scene (.xml), a ROS map (.yaml or its "
            "picture), or a lidar log (CARMEN .log[.gz], .scans.npz).",
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Scene to write (.yaml), or a folder for it.")],
    materials: Annotated[
        Path | None, typer.Option(help="YAML of 'pattern: material'; the first match by part name applies.")
    ] = None,
    default: Annotated[
        str | None, typer.Option(help="Material of unmatched parts; default: plasterboard, concrete for rooms.")
    ] = None,
    units: Annotated[str | None, typer.Option(help="Unit: m, cm, mm, in or ft; default: m if plausible.")] = None,
    up: Annotated[str | None, typer.Option(help="Up axis: y or z; default: estimated from the mesh.")] = None,
    floor: Annotated[bool, typer.Option(help="Move the floor of a mesh to z = 0.")] = True,
    budget: Annotated[int, typer.Option(help="Decimate a mesh to this many triangles.")] = 300_000,
    height: Annotated[float, typer.Option(help="Room height for a map or log, m.")] = 2.7,
    thickness: Annotated[float, typer.Option(help="Minimum wall thickness for a map or log, m.")] = 0.1,
    resolution: Annotated[float, typer.Option(help="Grid resolution for a log, m.")] = 0.05,
) -> None:
    """Import a mesh, a Mitsuba scene, a ROS map or a lidar log as a scene."""
    from radarsim.world.importers import Options, import_scene

    with progress(f"import {source.stem}") as report:
        done = import_scene(
            source, output, Options(materials, default, units, up, floor, budget, height, thickness, resolution),
            progress=report,
        )  # fmt: skip
    shown = sorted(done.rows, key=lambda row: -row.area)
    rows = [(row.part, row.material, row.chosen_by, row.triangles, f"{row.area:.2f}") for row in shown[:40]]
    for name in sorted({row.material for row in shown[40:]}):
        rest = [row for row in shown[40:] if row.material == name]
        triangles, area = sum(row.triangles for row in rest), sum(row.area for row in rest)
        rows.append((f"{len(rest)} more", name, "", triangles, f"{area:.2f}"))
    print_table(("part", "material", "by", "triangles", "area, m2"), rows, numbers=(3, 4))
    for remark in done.remarks:
        print(f"note: {remark}")
    print(done.path)


@app.command()
def export(
    recording: Annotated[Path, typer.Argument(metavar="REC.h5", help="Recording to convert.")],
    format: Annotated[str, typer.Option(help=f"Format: {', '.join(Plugins('radarize.exporters', 'export format'))}.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="File or, of ros2 and roverd, folder to write.")],
) -> None:
    """Write a recording in another format; `radarize export` has more options."""
    from radarize.io.exporters import export

    with progress("export") as report:
        written = export(recording, format, output, progress=report)
    print(written)


@app.command()
def emulate(
    source: Annotated[str, typer.Argument(metavar="SOURCE", help="Recording (.h5) to play, or scene to simulate.")],
    port_link: Annotated[Path | None, typer.Option(metavar="PATH", help="Symbolic link to the serial port.")] = None,
    host: Annotated[str, typer.Option(help="Address of the capture computer.")] = "127.0.0.1",
    board: Annotated[str, typer.Option(help="Address of the virtual DCA1000.")] = "127.0.0.2",
    command_port: Annotated[int, typer.Option(min=1, max=65535, help="UDP port for requests and replies.")] = 4096,
    data_port: Annotated[int, typer.Option(min=1, max=65535, help="UDP port for samples.")] = 4098,
    loop: Annotated[bool, typer.Option("--loop", help="Repeat the recording or walk forever.")] = False,
    loss: Annotated[float, typer.Option(min=0.0, max=1.0, help="Fraction of packets to drop.")] = 0.0,
    duplicate: Annotated[float, typer.Option(min=0.0, max=1.0, help="Fraction of packets to duplicate.")] = 0.0,
    reorder: Annotated[float, typer.Option(min=0.0, max=1.0, help="Fraction delayed by 1-8 packets.")] = 0.0,
    delay: Annotated[float, typer.Option(min=0.0, max=1.0, help="Fraction delayed by 100-400 packets.")] = 0.0,
    seed: Annotated[int, typer.Option(min=0, help="Random seed of packet faults and of a scene's tour.")] = 0,
    platform: Annotated[
        Literal["handheld", "cart", "robot"], typer.Option(help="Platform that carries the sensor in a scene.")
    ] = "handheld",
    duration: Annotated[float, typer.Option(min=0.0, help="Duration of the tour through a scene, s.")] = 40.0,
    radar: Annotated[str, typer.Option(help="Configuration expected for a scene: a .cfg or a preset.")] = "radarize",
    ahead: Annotated[float, typer.Option(min=0.0, help="Time to simulate ahead of transmission, s.")] = 10.0,
) -> None:
    """Emulate an IWR1843 with a DCA1000 on this machine: a serial port and UDP, for any capture software."""
    import time

    import numpy as np
    from rich.console import Console

    from radarsim.emulator.board import Addresses
    from radarsim.emulator.disturbance import Disturbance
    from radarsim.emulator.emulator import Emulator

    if Path(source).suffix == ".h5":
        from radarsim.emulator.source import Playback, Source

        given: Source = Playback(Path(source), loop)
    else:
        from radarsim.emulator.simulation import Simulation
        from radarsim.motion.walk import Walk

        given = Simulation(source, Walk(platform, duration), seed, radar, loop)
    disturbance = Disturbance(loss, duplicate, reorder, delay, np.random.default_rng(seed))
    console = Console(stderr=True)
    with Emulator(
        given, addresses=Addresses(board, host, command_port, data_port), port_link=port_link,
        disturbance=disturbance, ahead=ahead, log=lambda line: print(line, flush=True),
    ) as emulator:  # fmt: skip
        print(f"serial port {port_link or emulator.port}, 115200 baud", flush=True)
        print(f"DCA1000 {board}:{command_port}, sends to {host}:{command_port} and {host}:{data_port}", flush=True)
        try:
            with console.status("") as status:
                while True:
                    status.update(f"{emulator}; {emulator.ready} frames ready; Ctrl-C ends")
                    time.sleep(0.5)
        except KeyboardInterrupt:
            print(f"{emulator}; {disturbance}")


@app.command()
def schema(
    name: Annotated[str, typer.Argument(metavar="KIND", help="Of YAML file: scene, dataset, front-end or board.")],
) -> None:
    """Print the JSON schema of a kind of YAML file, by which editors complete and check it."""
    import json

    from radarsim.schema import schema

    print(json.dumps(schema(name), indent=2))


@app.command()
def doctor(
    report: Annotated[bool, typer.Option("--report", help="Print a text for bug reports instead.")] = False,
) -> None:
    """Check the machine for everything that simulation needs, and print how to install what is missing."""
    from radarsim.doctor import describe, examine

    if report:
        print(describe())
        return
    if not examine():
        raise InputError("this machine cannot simulate yet; run the commands above")


def main() -> None:
    """Entry point of the `radarsim` command."""
    run(app, "radarsim")


if __name__ == "__main__":
    main()
