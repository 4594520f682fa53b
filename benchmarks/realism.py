"""Realism of simulated walks: RadarHD's 25 training walks (Prabhakara et al., ICRA 2023) and cart walks through as many
generated buildings with the same chirps, as pictures of that paper.

A network is trained to classify pictures as real or simulated, and tested on other walks and buildings: 50 % is chance,
the ideal. Statistics of the pictures are compared as well. Clutter and roughness were chosen on the training walks,
with buildings of other seeds (4000 to 4009); test walks are only reported. RadarHD's repository has no licence:
pictures of its walks are written to a folder of the user's only.
"""

import argparse
from pathlib import Path

import numpy as np

from benchmarks.likeness import discriminator, statistics
from benchmarks.likeness.pictures import Bursts, Simulated, buildings, real
from benchmarks.likeness.sheet import draw
from benchmarks.results import SHARED, Data, NamedWalk, Page, performed, script

#: Simulated scenes that are compared with the real walks: fields of the scene files.
SETS = {"bare": {"clutter": 0.0, "unevenness": 0.0}, "furnished": {"clutter": 1.0, "unevenness": 1.0}}


def simulated(number: int, seed: int, surfaces: dict[str, float], workers: int | None) -> list[Bursts]:
    """Simulate bursts of walks through a number of buildings."""
    jobs = {about["name"]: Simulated(about, seed + k, surfaces) for k, about in enumerate(buildings(number, seed))}
    return performed(jobs, workers, "simulated walks")


def classified(walks: list[Bursts], others: list[Bursts], seed: int) -> dict[str, discriminator.Judged]:
    """Return the results of discriminators of single pictures and of pairs."""
    kinds = {"one picture": discriminator.single, "a pair 0.2 s apart": discriminator.pairs}
    return {
        name: discriminator.judge([of(walk) for walk in walks], [of(walk) for walk in others], seed)
        for name, of in kinds.items()
    }


def rows(found: dict[str, list[Bursts]], judged: dict[str, dict[str, discriminator.Judged]]) -> list[dict[str, object]]:
    """Return a row for each statistic with a column for each set: means over walks, and quartiles of the training
    walks."""
    table = [
        {"what": f"classified correctly, {kind} %"}
        | {name: 100 * judged[name][kind].accuracy.mean() if name in judged else None for name in found}
        for kind in next(iter(judged.values()))
    ]
    values = {name: [statistics.of(bursts) for bursts in walks] for name, walks in found.items()}
    for measure in values["real, train"][0]:
        each = {name: np.array([walk[measure] for walk in walks]) for name, walks in values.items()}
        low, high = np.quantile(each["real, train"], [0.25, 0.75])
        means = {name: value.mean() for name, value in each.items()}
        spread = {f"std. of {name}": value.std() for name, value in each.items() if name != "real, test"}
        table.append({"what": measure} | means | {"quartiles of real": f"{low:.3g} to {high:.3g}"} | spread)
    columns = dict.fromkeys(column for row in table for column in row)
    return [{column: row.get(column) for column in columns} for row in table]


@script(
    "Realism of simulated walks",
    recordings=(SHARED / "radarhd", "folder of the real walks"),
    walks=(25, "number of simulated walks, each through another building"),
    seed=(5000, "seed of buildings, walks and scenes, and of the discriminator"),
    sets=(",".join(SETS), "kinds of simulated scenes, comma-separated"),
    workers=(2, "number of processes"),
    sheets=("", "folder for sheets of real and simulated pictures; none if empty"),
)
def main(options: argparse.Namespace) -> Page:
    found = {"real, train": list(real(options.recordings, "train").values())}
    pictures = [walk.reshape(-1, *walk.shape[2:]) for walk in found["real, train"]]
    beams = {n: np.median([statistics.beam_misfit(every, n) for every in pictures]) for n in (4, 8)}
    judged, sets = {}, options.sets.split(",")
    for name in sets:
        found[name] = simulated(options.walks, options.seed, SETS[name], options.workers)
        judged[name] = classified(found["real, train"], found[name], options.seed)
        if options.sheets:
            draw(Path(options.sheets), name, found["real, train"], found[name], judged[name]["one picture"])
    found["real, test"] = list(real(options.recordings, "test").values())
    made = [NamedWalk(about["name"], options.seed + k, None, True) for k, about in
            enumerate(buildings(options.walks, options.seed))]  # fmt: skip
    recorded = [NamedWalk(f"RadarHD, {part}", None, None, simulated=False) for part in ("train", "test")
                for _ in found[f"real, {part}"]]  # fmt: skip
    return Page(
        rows(found, judged),
        data=Data("RadarHD's walks, and cart walks with their chirps", (*recorded, *made * len(sets)), options.seed),
        notes=[
            "classified correctly: balanced accuracy of a network on walks outside of its training set, mean over five "
            "folds; 50 % is chance. It is trained on training walks and simulated walks, with 200 pictures or 80 pairs "
            "per walk.",
            "A peak is the maximum of five ranges and nine azimuths. std.: standard deviation of the walks' means. "
            "Simulated carts are faster than the real radar: their frames have the same distances in space, not in "
            "time.",
            f"Rows of strong echoes in the training walks fit the beam of four antennas within {beams[4]:.1f} dB, that "
            f"of eight antennas within {beams[8]:.1f} dB: the published pictures are of one transmitter.",
            "Buildings A to D in turn. Clutter and roughness were chosen on the training walks; test walks are only "
            "reported.",
        ],
    )
