"""Sheets of real and simulated pictures, sorted by the output of the discriminator."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.likeness.discriminator import Judged
from benchmarks.likeness.pictures import Bursts
from radarize.signal import polar

#: Pictures of each kind on a sheet, each from a different walk.
COLUMNS = 10


def draw(folder: Path, name: str, real: list[Bursts], simulated: list[Bursts], judged: Judged) -> None:
    """Draw a sheet with the pictures of each kind with the largest and with the median output of the discriminator,
    each from a different walk; range is up, azimuth to the left."""
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
    figure.suptitle(f"{name}: largest output of the discriminator (upper rows), and median output (lower rows)")
    figure.tight_layout()
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / f"{name}.png", dpi=70)
    plt.close(figure)
