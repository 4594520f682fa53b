"""Interoperability: each export is read by an unmodified program of another project.

Programs on PyPI are installed into separate environments in `--environments`. Programs on GitHub only are run from
clones in `--clones` (`git clone https://github.com/OWNER/NAME`); missing ones are listed as not run. Programs under the
GPL are run in place, and none of their code is kept.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.results import Data, Page, script, tracked
from radarize.baselines.published.maps import PublishedMaps
from radarize.io.exporters import export
from radarize.io.recording import Recording
from radarize.pipeline.run import run
from radarsim.recording.simulate import simulate
from radarsim.world.export import export_scene
from radarsim.world.scene import Scene

SCENE, PLATFORM, SEED, DURATION = "office", "cart", 3, 1.5
#: Packages by environment; radarize_ae needs old versions.
PACKAGES = {
    "own": (),
    "rover": ("abstract_dataloader", "tyro", "einops", "optree", "jaxtyping", "pyyaml", "beartype", "scipy", "xwr"),
    "mcap": ("mcap", "numpy"),
    "ae": (
        "numba==0.57.1", "numpy==1.23.5", "scipy==1.10.1", "opencv-python-headless==4.6.0.66", "yacs", "tqdm",
        "open3d==0.18.0", "rosbags==0.9.20", "imageio", "pillow", "matplotlib",
    ),
}  # fmt: skip
#: Substitutes for modules of ROS 1, which are not on PyPI, with the functions that radarize_ae's create_dataset.py
#: uses.
ROS = {
    "rosbag.py": """
        from pathlib import Path
        from types import SimpleNamespace
        from rosbags.highlevel import AnyReader

        class Bag:
            def __init__(self, path, mode="r"):
                self.reader = AnyReader([Path(path)])
                self.reader.open()

            def of(self, topics):
                topics = [topics] if isinstance(topics, str) else topics
                return [c for c in self.reader.connections if c.topic in topics]

            def get_message_count(self, topics):
                return sum(c.msgcount for c in self.of(topics))

            def read_messages(self, topics):
                if connections := self.of(topics):
                    for connection, time, data in self.reader.messages(connections=connections):
                        message = self.reader.deserialize(data, connection.msgtype)
                        object.__setattr__(message, "_type", connection.msgtype.replace("/msg/", "/"))
                        yield connection.topic, message, SimpleNamespace(secs=time // 10**9, nsecs=time % 10**9)
        """,
    "sensor_msgs/__init__.py": "",
    "sensor_msgs/point_cloud2.py": """
        def read_points(message, skip_nans=False):
            return message.data.view("<f4").reshape(-1, len(message.fields))
        """,
    "cv_bridge.py": """
        class CvBridgeError(Exception):
            pass

        class CvBridge:
            pass
        """,
}  # fmt: skip


class Trial(NamedTuple):
    """An export and a program.

    Attributes:
        export: exported formats.
        program: name of the program.
        licence: licence of the program.
        clone: repository of the program, OWNER/NAME; None: it is on PyPI.
        run: runs the program, and returns its result.
    """

    export: str
    program: str
    licence: str
    clone: str | None
    run: Callable[["Bench"], str]


class Bench(NamedTuple):
    """Paths of the recording, its run, exports, clones and environments."""

    recording: Path
    run: Path
    folder: Path
    clones: Path
    environments: Path

    def python(self, name: str) -> str:
        """Return the interpreter of an environment, which is created if it does not exist."""
        if not PACKAGES[name]:
            return sys.executable
        home = self.environments / name
        interpreter = home / "bin" / "python"
        if not interpreter.exists():
            subprocess.run([sys.executable, "-m", "venv", home], check=True)
            subprocess.run([interpreter, "-m", "pip", "install", "-q", *PACKAGES[name]], check=True)
        return str(interpreter)

    def call(self, environment: str, code: str, *arguments: object, path: str = "", cwd: Path | None = None) -> dict:
        """Run a script, or a file of a script, and return the JSON in its last line of output."""
        words = [code] if code.endswith(".py") else ["-c", textwrap.dedent(code)]
        environ = {**os.environ, "PYTHONPATH": path, "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
        command = [self.python(environment), *words, *map(str, arguments)]
        done = subprocess.run(command, env=environ, cwd=cwd or self.folder, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError((done.stderr.strip().splitlines() or ["no words"])[-1])
        last = (done.stdout.strip().splitlines() or [""])[-1]
        return json.loads(last) if last.startswith("{") else {}


def open_radar(bench: Bench) -> str:
    path = export(bench.recording, "bin", bench.folder / "studio", iq_order="iiqq")
    with Recording(bench.recording) as recording:
        loops, tx, rx, samples, _ = recording.config.frame_shape
        own = recording.adc(0, 1)[0][:, [recording.config.tx.index(t) for t in recording.config.tx_order]]
    np.save(bench.folder / "own.npy", own[..., 0] + 1j * own[..., 1])
    found = bench.call(
        "own",
        """
        import importlib.util, json, sys
        import numpy as np
        spec = importlib.util.spec_from_file_location("adc", sys.argv[1])
        adc = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(adc)
        own = np.load("own.npy")
        raw = np.fromfile(sys.argv[2], np.int16, count=2 * own.size)
        frame = adc.DCA1000.organize(raw, own.shape[0] * own.shape[1], own.shape[2], own.shape[3])
        print(json.dumps({"equal": bool(np.array_equal(frame, own.reshape(frame.shape))), "shape": frame.shape}))
        """,
        bench.clones / "OpenRadar/mmwave/dataloader/adc.py", path,
    )  # fmt: skip
    assert found["equal"], found
    return f"samples equal, frame of {' x '.join(map(str, found['shape']))}"


def xwr_configuration(bench: Bench) -> str:
    path = export(bench.recording, "bin", bench.folder / "demo").with_suffix(".cfg")
    found = bench.call(
        "own",
        """
        import json, sys
        from radar_config import RadarConfig
        print(json.dumps(RadarConfig(open(sys.argv[1]).readlines()).get_params()))
        """,
        path, path=str(bench.clones / "xwr_raw_ros/src/xwr_raw"),
    )  # fmt: skip
    return (
        f"SDK {found['sdk']}, {found['platform']}, {found['n_chirps']} chirps, range bins of {found['range_res']:.4f} m"
    )


def radarize_ae(bench: Bench) -> str:
    """Make its data set from our bag, and compare its maps with ours."""
    bag = export(bench.recording, "radarize-ae", bench.folder / "walk_sc_1_0.bag", time_offset=0.0)
    modules = bench.folder / "ros"
    for name, text in ROS.items():
        (modules / name).parent.mkdir(parents=True, exist_ok=True)
        (modules / name).write_text(textwrap.dedent(text))
    home = bench.clones / "radarize_ae"
    bench.call("ae", "tools/create_dataset.py", "--bag_path", bag, path=f"{modules}:{home}", cwd=home)
    names = {"radar_d": "published_doppler_azimuth", "radar_de": "published_doppler_elevation_aware"}
    names |= {f"radar_r_{n}": f"published_range_azimuth_{n}" for n in (1, 3, 5)}
    names |= {f"radar_re_{n}": f"published_elevation_aware_{n}" for n in (1, 3, 5)}
    with Recording(bench.recording) as recording, np.load(bag.with_suffix(".npz")) as theirs:
        maker = PublishedMaps(recording.config)
        ours = maker(recording.adc(0, len(recording)), frames=slice(4, None))
        errors = np.concatenate([np.abs(ours[own] - theirs[other][2:, 0]).ravel() for other, own in names.items()])
        frames = len(theirs["time"])
    return (
        f"{frames} frames; maps differ by {errors.max():.1g} at most, {(errors < 1e-4).mean():.2%} of cells within 1e-4"
    )


def roverd(bench: Bench) -> str:
    folder = export(bench.recording, "roverd", bench.folder / "rover")
    found = bench.call(
        "rover",
        """
        import json, os, sys
        import numpy as np
        from roverd import sensors
        from xwr.rsp.numpy import AWR1843Boost
        radar = sensors.XWRRadar(os.path.join(sys.argv[1], "radar"))
        pose = sensors.Pose(os.path.join(sys.argv[1], "pose"))
        iq = radar[5]
        spectrum = AWR1843Boost(window=False)(iq.iq[:, 0])
        own = pose[5]
        velocity = (np.linalg.inv(own.rot) @ own.vel[..., None]).squeeze()
        print(json.dumps({
            "frames": len(radar.metadata.timestamps), "shape": spectrum.shape, "velocity": velocity.tolist(),
            "resolution": float(iq.range_resolution[0]),
        }))
        """,
        folder, path=str(bench.clones / "red-rover/format/src"),
    )  # fmt: skip
    with Recording(bench.recording) as recording:
        error = np.abs(np.array(found["velocity"]) - recording.read("truth/velocity")[5, :3]).max()
        assert error < 1e-3 and found["frames"] == len(recording)
        assert abs(found["resolution"] - recording.config.range_resolution) < 1e-6
    return (
        f"{found['frames']} frames, spectrum of {' x '.join(map(str, found['shape']))}, velocity within {error:.0e} m/s"
    )


def evo(bench: Bench) -> str:
    """Run evo_traj on the ROS 1 and ROS 2 bags and the TUM file."""
    bag1 = export(bench.recording, "radarize-ae", bench.folder / "evo.bag")
    bag2 = export(bench.recording, "ros2", bench.folder / "evo", run=bench.run)
    tum = export(bench.run, "tum", bench.folder / "evo.tum")
    program, lengths = Path(sys.executable).with_name("evo_traj"), []
    for words in (["bag", bag1, "/tracking/odom/sample"], ["bag2", bag2, "/odom", "/truth/odom"], ["tum", tum]):
        done = subprocess.run([program, *map(str, words)], capture_output=True, text=True, check=True)
        lengths += [line.split(",")[1].strip() for line in done.stdout.splitlines() if "path length" in line]
    return "; ".join(lengths)


def mcap(bench: Bench) -> str:
    from radarize.evaluation.mcap import write_mcap

    path = write_mcap(bench.recording, bench.run, bench.folder / "walk.mcap")
    found = bench.call(
        "mcap",
        """
        import json, sys
        from mcap.reader import make_reader
        summary = make_reader(open(sys.argv[1], "rb")).get_summary()
        counts = summary.statistics.channel_message_counts
        print(json.dumps({channel.topic: counts.get(key, 0) for key, channel in summary.channels.items()}))
        """,
        path,
    )  # fmt: skip
    return ", ".join(f"{topic} {count}" for topic, count in sorted(found.items()) if count)


def meshes(bench: Bench) -> str:
    """Read points, scans and the scene by Open3D."""
    points = export(bench.recording, "ply", bench.folder / "points.ply")
    scans = export(bench.run, "ply", bench.folder / "scans.ply")
    room = [export_scene(Scene.load(SCENE), bench.folder / f"room{suffix}") for suffix in (".ply", ".glb")]
    found = bench.call(
        "own",
        """
        import json, sys
        import open3d as o3d
        clouds = [len(o3d.io.read_point_cloud(path).points) for path in sys.argv[1:3]]
        meshes = [len(o3d.io.read_triangle_mesh(path).triangles) for path in sys.argv[3:]]
        print(json.dumps({"clouds": clouds, "meshes": meshes}))
        """,
        points, scans, *room,
    )  # fmt: skip
    assert min(found["clouds"] + found["meshes"]) > 0, found
    return f"{found['clouds'][0]} points, {found['clouds'][1]} of scans, rooms of {found['meshes']} triangles"


TRIALS = (
    Trial("bin, iiqq", "OpenRadar", "Apache-2.0", "PreSenseRadar/OpenRadar", open_radar),
    Trial("cfg", "xwr_raw_ros", "Apache-2.0", "ConnectedSystemsLab/xwr_raw_ros", xwr_configuration),
    Trial("radarize-ae", "radarize_ae create_dataset.py", "GPL-3", "ConnectedSystemsLab/radarize_ae", radarize_ae),
    Trial("roverd", "roverd, xwr", "MIT", "RadarML/red-rover", roverd),
    Trial("radarize-ae, ros2, tum", "evo_traj", "GPL-3", None, evo),
    Trial("mcap", "mcap", "MIT", None, mcap),
    Trial("ply, glb", "Open3D", "MIT", None, meshes),
)


def tried(trial: Trial, bench: Bench) -> dict[str, str]:
    """Run a program; return a row of the table."""
    if trial.clone is not None and not (bench.clones / trial.clone.split("/")[1]).is_dir():
        result = f"not run: no clone of github.com/{trial.clone}"
    else:
        try:
            result = trial.run(bench)
        except Exception as error:  # of other programs: the remaining ones are run
            result = f"failed: {' '.join(str(error).split())[:200] or type(error).__name__}"
    return {"export": trial.export, "program": trial.program, "licence": trial.licence, "found": result}


def simulated(path: Path) -> Path:
    """Simulate a recording to export."""
    sensors = ("depth-strip", "imu")
    return simulate(SCENE, path, platform=PLATFORM, duration=DURATION, seed=SEED, sensors=sensors)


@script(
    "Exports read by other programs",
    clones=("clones", "folder of clones of programs that are not on PyPI"),
    environments=("", "folder for environments, which are used again; a temporary one if empty"),
    recording=("", "recording of few frames with depth strip, IMU and truth; 1.5 s are simulated if empty"),
)
def main(options: argparse.Namespace) -> Page:
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        recording = Path(options.recording).resolve() if options.recording else simulated(folder / "walk.h5")
        done = folder / "run"
        run(recording, done, odometry="doppler", scans="first-echo")
        environments = Path(options.environments).resolve() if options.environments else folder / "environments"
        bench = Bench(recording, done, folder, Path(options.clones).resolve(), environments)
        rows = [tried(trial, bench) for trial in tracked(TRIALS, "programs")]
        with Recording(recording) as source:
            walk = f"{source.attributes.get('scene', recording.stem)}, {PLATFORM}, {len(source)} frames"
    notes = (
        "The radar is the preset `radarize`. The modules of ROS 1 that radarize_ae imports are replaced by this "
        "script.",
        "Differences to maps of radarize_ae above 1e-4 are due to its single precision, beside strong echoes.",
    )
    return Page(rows, Data(f"a simulated walk with depth strip and IMU: {walk}", (), SEED), notes)
