"""Twins of a walk that plays the real one, each with one error: what the figures of `radarsim twin` make of it."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import h5py
import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from benchmarks.results import Data, command_line, publish
from radarize.console import progress
from radarsim.scene.materials import MATERIALS
from radarsim.scene.scene import Scene
from radarsim.simulate import simulate
from radarsim.twin.comparison import Comparison, compare
from radarsim.twin.twin import make_twin

#: Takes a recording's poses and the open file; returns other poses.
Change = Callable[[np.ndarray, h5py.File], np.ndarray]
#: Columns: name of the figure, its words, factor.
COLUMNS = {
    "correlation_range_azimuth": ("correlation of range-azimuth", 1),
    "correlation_doppler_azimuth": ("of Doppler-azimuth", 1),
    "similarity_range_azimuth": ("MS-SSIM of range-azimuth", 1),
    "profile_correlation": ("correlation of range profiles", 1),
    "gain": ("gain dB", 1),
    "noise": ("noise dB", 1),
    "velocity": ("velocities differ by m/s", 1),
    "bearings_within_10cm": ("bearings within 10 cm %", 100),
}


def altered(recording: Path, path: Path, change: Change) -> Path:
    """A copy of a recording whose poses, and more, were changed."""
    shutil.copy(recording, path)
    with h5py.File(path, "r+") as file:
        file["truth/pose"][:] = change(file["truth/pose"][:], file)
    return path


def shaken(metres: float, degrees: float) -> Change:
    """Slow errors of poses, standard deviations."""

    def change(poses: np.ndarray, file: h5py.File) -> np.ndarray:
        noise = gaussian_filter1d(np.random.default_rng(1).standard_normal((len(poses), 6)), 2, axis=0)
        noise /= noise.std(axis=0)
        turn = Rotation.from_rotvec(np.deg2rad(degrees) * noise[:, 3:]) * Rotation.from_quat(poses[:, 3:])
        return np.hstack([poses[:, :3] + metres * noise[:, :3], turn.as_quat()])

    return change


def row(name: str, found: Comparison) -> dict[str, object]:
    """Medians over frames."""
    medians = {
        words: factor * float(np.nanmedian(found.figures[figure])) for figure, (words, factor) in COLUMNS.items()
    }
    return {"twin": name, **medians, "Fréchet distance dB": found.frechet["range_azimuth"][0]}


PARSER = command_line(
    __doc__,
    duration=(20.0, "of the walk, s"),
    seed=(3, "of walk and twins"),
)


def main() -> None:
    options = PARSER.parse_args()
    place = Scene.load("office")

    def all_of(material: str) -> Scene:
        return Scene(
            "office", [replace(thing, material=MATERIALS[material]) for thing in place.objects], life=place.life
        )

    rows = []
    with TemporaryDirectory() as temporary, progress("twins") as report:
        folder = Path(temporary)
        real = simulate("office", folder / "real.h5", platform="cart", duration=options.duration, seed=options.seed)
        twins = [
            ("the same again", place, real, options.seed),
            ("other speckle and noise", place, real, options.seed + 6),
            *(
                (f"poses off by {metres:g} m and {degrees:g} deg", place, (metres, degrees), options.seed + 6)
                for metres, degrees in ((0.01, 0.3), (0.03, 1.0), (0.1, 3.0))
            ),
            *((f"all of {name}", all_of(name), real, options.seed + 6) for name in ("brick", "metal")),
            ("another building", Scene.load("floor"), real, options.seed + 6),
        ]
        for k, (name, scene, recording, seed) in enumerate(twins):
            report(k, len(twins))
            if isinstance(recording, tuple):
                recording = altered(real, folder / f"poses{k}.h5", shaken(*recording))
            made = make_twin(recording, scene, folder / f"twin{k}.h5", every=3, seed=seed)
            rows.append(row(name, compare(real, made)))
        report(len(twins), len(twins))
        data = Data.of("a walk in the place of the real one, and twins", [real, *folder.glob("twin*.h5")], options.seed)
    publish(
        "twin",
        "Twins of a simulated walk, each with one error",
        rows,
        data=data,
        networks=(),
        notes=[
            f"A cart in the office for {options.duration:g} s plays the real recording. Every third frame, medians "
            "over frames; MS-SSIM and correlations are 1 for equal maps; Fréchet's distance is of patch statistics of "
            "range-azimuth maps. Errors of poses are smooth over two frames, 67 ms; standard deviations of each axis.",
        ],
    )


if __name__ == "__main__":
    main()
