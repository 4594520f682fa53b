"""Twins of a walk that plays the real one, each with one error: what the figures of `radarsim twin` make of it."""

import argparse
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.results import Data, Page, script, tracked
from radarsim.recording.simulate import simulate
from radarsim.twin.comparison import FIGURES, Comparison, compare
from radarsim.twin.twin import Options, make_twin
from radarsim.world.materials import MATERIALS
from radarsim.world.scene import Scene
from tests.twin.poses import Change, altered, shaken

#: Of `radarsim.twin.comparison.FIGURES`.
SHOWN = ("correlation_range_azimuth", "correlation_doppler_azimuth", "similarity_range_azimuth", "profile_correlation",
         "gain", "noise", "velocity", "bearings_within_10cm")  # fmt: skip


def row(name: str, found: Comparison) -> dict[str, object]:
    """Medians over frames."""
    words = {figure: ", ".join(filter(None, (figure.replace("_", " "), FIGURES[figure][0]))) for figure in SHOWN}
    medians = {words[figure]: float(np.nanmedian(found.figures[figure])) for figure in SHOWN}
    return {"twin": name, **medians, "Fréchet distance, dB": found.frechet["range_azimuth"][0]}


@script(
    "Twins of a simulated walk, each with one error", duration=(20.0, "of the walk, s"), seed=(3, "of walk and twins")
)
def main(options: argparse.Namespace) -> Page:
    office, other, rows = Scene.load("office"), options.seed + 6, []

    def all_of(material: str) -> Scene:
        objects = [replace(each, material=MATERIALS[material]) for each in office.objects]
        return Scene("office", objects, surface_settings=office.surface_settings)

    twins: list[tuple[str, Scene, Change | None, int]] = [
        ("the same again", office, None, options.seed),
        ("other speckle and noise", office, None, other),
        *(
            (f"poses off by {metres:g} m and {degrees:g} deg", office, shaken(metres, degrees), other)
            for metres, degrees in ((0.01, 0.3), (0.03, 1.0), (0.1, 3.0))
        ),
        *((f"all of {name}", all_of(name), None, other) for name in ("brick", "metal")),
        ("another building", Scene.load("floor"), None, other),
    ]
    with TemporaryDirectory() as temporary:
        folder = Path(temporary)
        real = simulate("office", folder / "real.h5", platform="cart", duration=options.duration, seed=options.seed)
        for k, (name, scene, change, seed) in enumerate(tracked(twins, "twins")):
            source = altered(real, folder / f"poses{k}.h5", change) if change else real
            made = make_twin(source, scene, folder / f"twin{k}.h5", Options(every=3, seed=seed))
            rows.append(row(name, compare(real, made)))
        data = Data.of("a walk in the place of the real one, and twins", [real, *folder.glob("twin*.h5")], options.seed)
    return Page(
        rows,
        data=data,
        notes=[
            f"A cart in the office for {options.duration:g} s plays the real recording. Every third frame, medians "
            "over frames; MS-SSIM and correlations are 1 for equal maps; Fréchet's distance is of patch statistics of "
            "range-azimuth maps. Errors of poses are smooth over two frames, 67 ms; standard deviations of each axis.",
        ],
    )
