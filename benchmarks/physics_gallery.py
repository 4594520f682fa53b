"""The gallery of physical laws: docs/physics.md and its plots.

    python -m benchmarks.physics_gallery

Laws stand in `benchmarks.gallery`; references that tests use too in `benchmarks.references`. To add one, write it there
and enter it in `LAWS`.
"""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from benchmarks.gallery import reflectors, rooms, signals, surfaces
from benchmarks.gallery.drawing import CONFIG, LEVEL

DOCS = Path(__file__).parents[1] / "docs"

WORDS = (
    ("one-way, two-way path", "from the radar to a scatterer; out on one and back on another", "radar equation"),
    ("flat, round reflector", "a flat part of a scene with its aperture; a sphere or cylinder", "Knott, RCS"),
    ("patch", "a piece of a smooth curved surface", "Deschamps, Proc. IEEE 1972"),
    ("specular candidate", "a mirror, or two, over which a scatterer may be seen", "image theory, Balanis"),
    ("image method, chain", "the radar seen in two or three mirrors one after another", "Allen, Berkley, JASA 1979"),
    ("Fresnel unit, aperture", "sqrt(lambda d (L - d) / 2L); what an opening passes", "Born, Wolf, ch. 8"),
    ("specular reflection", "the echo of a reflector that faces the radar", "Gordon, IEEE TAP 1975"),
    ("scattering pattern", "how a rough surface shares out its diffuse echo", "Degli-Esposti, IEEE TAP 2007"),
    ("transmission, slab", "what a pane, door or board lets through, and how late", "ITU-R P.2040"),
    ("moving target", "what moves by itself", "Skolnik, Radar Handbook"),
    ("moving plate", "the leaf of a door: a reflector and a slab that swings", "Chen, Micro-Doppler Effect in Radar"),
    ("sideband", "phase noise beside an echo", "Richards, Fundamentals of Radar Signal Processing"),
)

#: Sections of the page: what draws and measures, its docstring is the law; and labels of x and y.
LAWS = {
    "Point target": (reflectors.point_target, "range, m", LEVEL),
    "Wall": (reflectors.wall_flash, "distance of a concrete wall, m", LEVEL),
    "Plate": (reflectors.plate, "angle off the normal, deg", LEVEL),
    "Small mirrors": (reflectors.small_mirrors, "side, m", LEVEL),
    "Sphere and corners": (reflectors.round_and_corners, "angle off the axis, deg", "radar cross section, dBsm"),
    "Corner out of square": (
        reflectors.corner_out_of_square,
        "angle over 90 deg, deg",
        "echo over a square corner's, dB",
    ),
    "Smooth surfaces": (reflectors.smooth_surfaces, "along the way", LEVEL),
    "Box room": (rooms.box_room, "path, m", "images up to it"),
    "Thin pole": (rooms.thin_pole, "offset of the pole, mm", "of the reflection without it, dB"),
    "Slab": (rooms.slab, "angle of incidence, deg", "TE coefficient, dB"),
    "Panes": (rooms.panes, "range, m", "over the largest, dB"),
    "Hollow wall": (rooms.hollow_wall, "range, m", "over the front, dB"),
    "Phantom": (rooms.phantom, "azimuth, deg (left positive)", "range, m"),
    "Moving door": (rooms.moving_door, "angle, deg", "closing speed of the reflection, m/s"),
    "Doppler signature": (signals.doppler, "azimuth, deg (left positive)", "closing speed, m/s"),
    "TDM slots": (signals.tdm, "closing speed, m/s", "phase against TX1, deg"),
    "Within a burst": (signals.range_walk, "loop", "range that the beat frequency stands for, m"),
    "Thermal noise": (signals.noise, "receive gain, dB", "noise over k T B, dB"),
    "Phase noise": (signals.phase_noise, "range bin", "dBc/Hz"),
    "Interference": (signals.interference, "since the ramp's start, us", LEVEL),
    "Speckle": (surfaces.speckle, "amplitude over its scale", "share of cells below"),
    "Speckle under motion": (surfaces.decorrelation, "sideways displacement, mm", "correlation with the field at rest"),
    "Convergence": (surfaces.convergence, "scatterers on 12 m2 of wall", "mean power per cell, dB"),
    "Clutter": (surfaces.small_things, "radar cross section, dBsm", "share below"),
    "Uneven walls": (surfaces.uneven_walls, "along the wall, mm", "correlation of the reflection"),
    "Reciprocity": (surfaces.reciprocity, "power of the difference over the field's, dB", ""),
}


def main() -> None:
    pictures = DOCS / "physics"
    pictures.mkdir(parents=True, exist_ok=True)
    page = (
        "# The physics, law by law\n\n"
        "Each plot compares the simulator with theory: a closed form, or a sum that was programmed independently. The "
        f"radar is the preset `radarize` (centre {CONFIG.center_frequency / 1e9:.2f} GHz). "
        "`python -m benchmarks.physics_gallery` writes this page, its figures and its plots. Tests in "
        "`tests/propagation` check the same laws.\n"
        "\n## Words\n\n| here | is | source |\n|---|---|---|\n" + "".join(f"| {' | '.join(row)} |\n" for row in WORDS)
    )
    for title, (draw, x, y) in LAWS.items():
        figure, axis = plt.subplots(figsize=(5.4, 3.2))
        measured, name, about = draw(axis), draw.__name__, " ".join(draw.__doc__.split())
        print(f"{title}: {measured}")
        axis.set(xlabel=x, ylabel=y)
        axis.grid(alpha=0.3)
        if axis.get_legend_handles_labels()[0]:
            axis.legend(fontsize=8)
        figure.savefig(pictures / f"{name}.png", dpi=90, bbox_inches="tight")
        plt.close(figure)
        page += f"\n## {title}\n\n{about}\n\n![{title}](physics/{name}.png)\n\n{measured}\n"
    (DOCS / "physics.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
