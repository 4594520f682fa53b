"""Files that README and docs assume: a capture, a map, a mesh, scans of another sensor."""

import gzip
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
import yaml
from PIL import Image

from radarize.io.exporters import export
from radarize.io.recording import Recording
from radarize.pipeline.config import Configuration
from radarsim.world.description import shipped
from tests.io.importers.ros import write_published
from tests.io.importers.rover import write_sequence
from tests.io.importers.test_import_pcap import pcap, stream

#: Of data sets: recordings that are made of them, by building and platform; two variants, of `SECONDS` each. What their
#: buildings are called is their own, what is walked through is `PLACE`, which takes no time to build and to plan in.
DATASETS = {
    "small": {"A": ("handheld", "cart"), "B": ("robot",)},
    "radarize146": {"A": ("handheld", "cart"), "B": ("robot",)},
    "inertial": {"A101": ("handheld", "cart")},
    "stress": {"corner": ("cart",)},
    "radarhd": {"A401": ("cart", "handheld")},
    "ablation/loops": {"A701": ("handheld",)},
    "radars": {"A501": ("handheld",)},
}
#: Whether all pages are typed, or README alone.
ALL = "DOCUMENTS" in os.environ
SECONDS, PLACE = 1.5 if ALL else 0.8, "stress/corner"  # RadarHD, of another page, wants 41 frames


def specification(name: str, path: Path) -> None:
    """A data set of the project, shortened."""
    assert name in DATASETS, f"data set {name} is none of DATASETS, which has the shortened size of each"
    folder = shipped() / "datasets"
    data, kept = yaml.safe_load((folder / f"{name}.yaml").read_text()), DATASETS[name]
    groups = {group["building"]: group for group in reversed(data["recordings"])}
    for group in groups.values():
        group.pop("floors", None)
    data["recordings"] = [
        groups[building] | {"platform": [*platforms], "count": 1, "duration": SECONDS}
        for building, platforms in kept.items()
    ]
    data["buildings"] = dict.fromkeys(kept, PLACE)
    data["variants"] = dict(list(data.get("variants", {}).items())[:2])
    if data["sensors"] == "all":
        data["sensors"] = ["occupancy", "imu"]
    if (radar := folder / data.get("radar", "")).is_file():
        data["radar"] = str(radar)
    for split in data.get("splits", {}).values():
        split |= {"train": 0.34, "validation": 0.33, "test": 0.33, "folds": 1} if split["kind"] == "random" else {}
        for key in {"building": ("held_out",), "platform": ("test",)}.get(split["kind"], ()):
            split.pop(key, None)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(yaml.safe_dump(data))


def _plan(path: Path) -> None:
    """A map of a room of 8 x 6 m for map_server, with its image."""
    pixels = np.full((140, 180), 205, np.uint8)
    pixels[10:130, 10:170] = 254
    pixels[[10, 129], 10:170] = pixels[10:130, [10]] = pixels[10:130, [169]] = 0
    Image.fromarray(pixels).save(path.with_suffix(".pgm"))
    about = {"image": "map.pgm", "resolution": 0.05, "origin": [0.0, 0.0, 0.0], "negate": 0}
    path.write_text(yaml.safe_dump(about | {"occupied_thresh": 0.65, "free_thresh": 0.196}))


def _square(bearings: np.ndarray, x: float) -> np.ndarray:
    """Ranges from (x, 0) to the walls of a room of 6 x 6 m around the origin."""
    with np.errstate(divide="ignore"):
        across = np.where(np.cos(bearings) > 0, 3 - x, 3 + x) / np.abs(np.cos(bearings))
        return np.minimum(across, 3 / np.abs(np.sin(bearings)))


def _scans(path: Path) -> None:
    bearings = np.linspace(-np.pi / 2, np.pi / 2, 181)
    ranges = np.array([_square(bearings, 0.05 * k) for k in range(20)])
    np.savez(path, ranges=ranges, angle_min=bearings[0], angle_increment=bearings[1] - bearings[0], range_max=30.0)


def _odometry(path: Path) -> None:
    path.write_text("".join(f"{k} {0.05 * k} 0 0 0 0 0 1\n" for k in range(20)))


def _carmen(path: Path) -> None:
    bearings = np.linspace(-np.pi / 2, np.pi / 2, 181)
    lines = []
    for k in range(40):
        x, turn = 0.05 * k, 0.3 * k
        numbers = " ".join(f"{r:.3f}" for r in _square(bearings + turn, x))
        lines.append(f"FLASER 181 {numbers} {x} 0 {turn} {x} 0 {turn} {k} host {k}")
    path.write_bytes(gzip.compress("\n".join(lines).encode()))


def _mesh(path: Path) -> None:
    path.parent.mkdir(exist_ok=True)
    room = trimesh.creation.box(extents=(6, 4, 2.6))
    room.invert()
    room.export(path)


def _capture(path: Path) -> None:
    export(path.with_name("walk.h5"), "bin", path.with_name("given"))
    path.with_name("given.bin").rename(path)
    path.with_name("given.cfg").rename(path.with_name("profile.cfg"))


def _cube(path: Path) -> None:
    """Samples of two transmitters and four receivers (loop, channel, sample)."""
    noise = np.random.default_rng(0).normal(0, 30, (2, 32, 8, 64))
    np.save(path, (noise[0] + 1j * noise[1]).astype(np.complex64))


def _way(path: Path) -> None:
    with Recording(path.with_name("walk.h5")) as recording:
        places = recording.read("truth/pose")[[0, -1], :2]
    path.write_text("x,y\n" + "".join(f"{x:.3f},{y:.3f}\n" for x, y in places))


#: A public capture of mmWave Studio, where the public recordings are at hand.
STUDIO = Path(__file__).resolve().parents[3] / "shared" / "recordings" / "iwr6843-studio"


def _studio(path: Path) -> None:
    path.mkdir()
    for file in STUDIO.iterdir():
        shutil.copyfile(file, path / file.name)


def _clone(path: Path) -> None:
    """A walk in the layout of RadarHD's repository, with a wall ahead."""
    for kind, columns, name in (("radar", 64, "R"), ("lidar", 512, "L")):
        (path / "test" / kind).mkdir(parents=True)
        picture = np.zeros((256, columns), np.uint8)
        picture[75, columns // 4 : 3 * columns // 4] = 255
        for k in range(44):
            Image.fromarray(picture).save(path / "test" / kind / f"{name}_227_{k}.png")


#: How each comes to be in a folder where `walk.h5` is there, in this order.
GIVEN: dict[str, Callable[[Path], object]] = {
    "real.h5": lambda path: shutil.copy(path.with_name("walk.h5"), path),
    "still.h5": lambda path: shutil.copy(path.with_name("walk.h5"), path),
    "room.yaml": lambda path: shutil.copy(shipped() / "office.yaml", path),
    "my_scene.yaml": lambda path: shutil.copy(shipped() / "office.yaml", path),
    "poses.tum": lambda path: export(path.with_name("walk.h5"), "tum", path),
    "tracking.tum": lambda path: export(path.with_name("walk.h5"), "tum", path),
    "adc_data.bin": _capture,  # and profile.cfg
    "cart_sc_1_0.bag": lambda path: write_published(path, path.with_name("walk.h5")),
    "capture.pcap": lambda path: pcap(path, stream()),
    "studio_folder": _studio,
    "cube.npy": _cube,
    "way.csv": _way,
    "map.yaml": _plan,
    "SCANS.npz": _scans,
    "ODOMETRY.tum": _odometry,
    "intel-corrected.log.gz": _carmen,
    "replica/mesh_semantic.ply": _mesh,
    "RadarHD/dataset_5": _clone,
    "any-radar": lambda path: shutil.copytree(path.with_name("small"), path),
    "iq1m/indoor/baker/baker.1.fwd": write_sequence,
    "mine.yaml": lambda path: path.write_text(Configuration().text()),
    "materials.yaml": lambda path: path.write_text('"*": brick\n'),
}
