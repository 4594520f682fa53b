"""Pictures of either kind side by side, and what the discriminator looks at in them."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.likeness.discriminator import Judged
from benchmarks.likeness.pictures import Bursts
from radarize.signal import polar

#: Pictures of each kind on a sheet, each of another walk.
COLUMNS = 10


def draw(folder: Path, name: str, real: list[Bursts], simulated: list[Bursts], judged: Judged) -> None:
    """Draw a sheet: of each kind, the pictures of which the discriminator is most certain and those of the median
    certainty, each of another walk, range upward and azimuth to the left."""
    figure, axes = plt.subplots(4, COLUMNS, figsize=(2 * COLUMNS, 12), sharex=True, sharey=True)
    kinds = ("real", real, [-output for output in judged.real]), ("simulated", simulated, judged.simulated)
    for row, (kind, walks, outputs) in enumerate(kinds):
        order = np.argsort([-np.median(output) for output in outputs])
        for share, line in ((1.0, axes[row]), (0.5, axes[row + 2])):
            for axis, walk in zip(line, order[:COLUMNS] if share == 1 else order[::2][:COLUMNS], strict=False):
                index = np.argsort(outputs[walk])[int(share * (len(outputs[walk]) - 1))]
                picture = walks[walk].reshape(-1, polar.ROWS, polar.COLUMNS)[index]
                axis.imshow(
                    picture[:, ::-1], origin="lower", aspect="auto", cmap="magma", extent=(90, -90, 0, polar.REACH)
                )
                axis.set_title(f"{kind}, {outputs[walk][index]:+.1f}", fontsize=8)
    figure.supxlabel("azimuth, deg")
    figure.supylabel("range, m")
    figure.suptitle(f"{name}: of which the discriminator is most certain (upper rows), and of the median certainty")
    figure.tight_layout()
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / f"{name}.png", dpi=70)
    plt.close(figure)
