"""Selection of the submaps that an endless session removes: those of places that newer submaps cover.

After Cartographer's trimmer of overlapping submaps, with poses of nodes instead of cells.
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from radarize.slam.submap import Submap

#: Number of newer submaps that cover each place of a redundant one; it keeps the two submaps being built.
_MIN_COVER = 3
#: Size of a place: m, and rad of heading, as a radar sees only one side of a wall.
_PLACE_SIZE, _PLACE_SECTOR = 1.0, np.pi / 2


def redundant_submaps(submaps: Sequence[Submap], poses: Float[np.ndarray, "node 3"]) -> list[Submap]:
    """Return the submaps whose places are all covered by enough newer submaps that stay."""
    seen: Counter[tuple[int, ...]] = Counter()
    found = []
    for submap in reversed(submaps):
        places = {
            tuple(place)
            for place in np.floor(poses[submap.nodes] / (_PLACE_SIZE, _PLACE_SIZE, _PLACE_SECTOR)).astype(int)
        }
        if all(seen[place] >= _MIN_COVER for place in places):
            found.append(submap)
        else:
            seen.update(places)
    return found
