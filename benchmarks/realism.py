"""How like real walks simulated ones are: RadarHD's 25 training walks (Prabhakara et al., ICRA 2023) and walks by cart
through as many generated buildings with the same chirps, both through the picture chain of that paper.

A network is trained to tell one from the other, on walks and buildings other than those it is judged on: 50 % is
chance, so perfect likeness. Beside it stand statistics of the pictures. Clutter and roughness were chosen beside the
training walks, in buildings of other seeds (4000 to 4009); the test walks are only reported. RadarHD's repository has
no licence: pictures of its walks are drawn into a folder of the user's and are no part of this page.
"""

import argparse
from pathlib import Path

import numpy as np

from benchmarks.likeness import discriminator, statistics
from benchmarks.likeness.pictures import Bursts, Simulated, buildings, real
from benchmarks.likeness.sheet import draw
from benchmarks.results import SHARED, Data, NamedWalk, Page, performed, script

#: What is compared with the real walks: fields of the scene files.
SETS = {"bare": {"clutter": 0.0, "unevenness": 0.0}, "furnished": {"clutter": 1.0, "unevenness": 1.0}}


def simulated(number: int, seed: int, surfaces: dict[str, float], workers: int | None) -> list[Bursts]:
    """Bursts of walks through so many buildings."""
    jobs = {about["name"]: Simulated(about, seed + k, surfaces) for k, about in enumerate(buildings(number, seed))}
    return performed(jobs, workers, "simulated walks")


def told_apart(walks: list[Bursts], others: list[Bursts], seed: int) -> dict[str, discriminator.Judged]:
    """Judgements of a discriminator of single pictures and of one of pairs."""
    kinds = {"one picture": discriminator.single, "a pair 0.2 s apart": discriminator.pairs}
    return {
        name: discriminator.judge([of(walk) for walk in walks], [of(walk) for walk in others], seed)
        for name, of in kinds.items()
    }


def rows(found: dict[str, list[Bursts]], judged: dict[str, dict[str, discriminator.Judged]]) -> list[dict[str, object]]:
    """A row a measure, a column a set: means over walks; of the training walks the middle half, too."""
    table = [
        {"what": f"told apart, {kind} %"}
        | {name: 100 * judged[name][kind].accuracy.mean() if name in judged else None for name in found}
        for kind in next(iter(judged.values()))
    ]
    values = {name: [statistics.of(bursts) for bursts in walks] for name, walks in found.items()}
    for measure in values["real, train"][0]:
        each = {name: np.array([walk[measure] for walk in walks]) for name, walks in values.items()}
        low, high = np.quantile(each["real, train"], [0.25, 0.75])
        means = {name: value.mean() for name, value in each.items()}
        spread = {f"spread of {name}": value.std() for name, value in each.items() if name != "real, test"}
        table.append({"what": measure} | means | {"middle half of real": f"{low:.3g} to {high:.3g}"} | spread)
    columns = dict.fromkeys(column for row in table for column in row)
    return [{column: row.get(column) for column in columns} for row in table]


@script(
    "How like real walks simulated ones are",
    recordings=(SHARED / "radarhd", "folder of the real walks"),
    walks=(25, "simulated walks, each through a building of its own"),
    seed=(5000, "of buildings, walks and worlds, and of the discriminator"),
    sets=(",".join(SETS), "simulated rooms, by commas"),
    workers=(2, "processes"),
    sheets=("", "folder for sheets of pictures, real ones among them; none if empty"),
)
def main(options: argparse.Namespace) -> Page:
    found = {"real, train": list(real(options.recordings, "train").values())}
    pictures = [walk.reshape(-1, *walk.shape[2:]) for walk in found["real, train"]]
    beams = {n: np.median([statistics.beam_misfit(every, n) for every in pictures]) for n in (4, 8)}
    judged, sets = {}, options.sets.split(",")
    for name in sets:
        found[name] = simulated(options.walks, options.seed, SETS[name], options.workers)
        judged[name] = told_apart(found["real, train"], found[name], options.seed)
        if options.sheets:
            draw(Path(options.sheets), name, found["real, train"], found[name], judged[name]["one picture"])
    found["real, test"] = list(real(options.recordings, "test").values())
    made = [NamedWalk(about["name"], options.seed + k, None, True) for k, about in
            enumerate(buildings(options.walks, options.seed))]  # fmt: skip
    recorded = [NamedWalk(f"RadarHD, {part}", None, None, simulated=False) for part in ("train", "test")
                for _ in found[f"real, {part}"]]  # fmt: skip
    return Page(
        rows(found, judged),
        data=Data("RadarHD's walks and walks by cart with their chirps", (*recorded, *made * len(sets)), options.seed),
        notes=[
            "Told apart: balanced accuracy of a network on walks that it has not seen, mean of five folds; 50 % is "
            "chance. It is trained on the training walks and the simulated ones, 200 pictures or 80 pairs a walk.",
            "A peak is the largest of five ranges and nine azimuths. Spread: of the walks' means. Carts are faster "
            "than the real radar: their frames are as far apart in space as the real ones, not in time.",
            f"Rows of strong echoes in the training walks fit the beam of four antennas within {beams[4]:.1f} dB, of "
            f"eight within {beams[8]:.1f} dB: the published pictures are of one transmitter.",
            "Buildings A to D by turns. Clutter and roughness were chosen beside the training walks; the test walks "
            "are only reported.",
        ],
    )
