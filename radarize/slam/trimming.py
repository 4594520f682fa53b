"""What a session without end may forget: submaps of places that others have shown since.

After the idea of Cartographer's trimmer of overlapping submaps, by where nodes stood and looked instead of by cells.
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from radarize.slam.submap import Submap

#: Later submaps that must have been at each of a submap's places; of the two being built none is ever forgotten.
_ENOUGH = 3
#: Of places: m, and rad of heading, for a radar sees one side of a wall.
_SIDE, _SECTOR = 1.0, np.pi / 2


def redundant_submaps(submaps: Sequence[Submap], poses: Float[np.ndarray, "node 3"]) -> list[Submap]:
    """Those at all of whose places enough of the later ones have been that stay."""
    seen, found = Counter(), []
    for submap in reversed(submaps):
        places = {tuple(place) for place in np.floor(poses[submap.nodes] / (_SIDE, _SIDE, _SECTOR)).astype(int)}
        if all(seen[place] >= _ENOUGH for place in places):
            found.append(submap)
        else:
            seen.update(places)
    return found
