"""Ray-traced simulation of the IWR1843 radar in indoor meshes, written as raw int16 I/Q.

import radarsim

rec = radarsim.simulate("office", duration=10, seed=3)
"""

import os
from pathlib import Path
from typing import TYPE_CHECKING

from radarsim.machine.kernels import drop_stale

# Compiled loops last a millisecond or less. OpenMP's threads would spin between them, for milliseconds, on the cores
# that Mitsuba's threads and whatever else runs need: that doubled the time of a frame. Read when the library loads.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

# Open3D brings an old TBB along, of which Numba complains before it takes the next: it need not look there first.
os.environ.setdefault("NUMBA_THREADING_LAYER_PRIORITY", "omp tbb workqueue")

drop_stale(Path(__file__).parent)

if TYPE_CHECKING:
    from radarsim.api import simulate as simulate

__all__ = ["simulate"]


def __getattr__(name: str) -> object:
    """`simulate`, loaded at its first use."""
    if name not in __all__:
        raise AttributeError(f"module 'radarsim' has no attribute {name!r}")
    from radarsim.api import simulate

    globals()[name] = simulate
    return simulate
