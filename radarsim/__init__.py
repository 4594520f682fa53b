"""Ray-traced simulation of TI mmWave radars in indoor meshes, written as raw int16 I/Q.

import radarsim

rec = radarsim.simulate("office", duration=10, seed=3)
"""

import os
from pathlib import Path
from typing import TYPE_CHECKING

from radarsim.machine.kernels import drop_stale

# Numba's compiled loops last a millisecond or less. OpenMP threads that spin between them occupy the cores that Mitsuba
# and other processes need, which doubles the time of a frame. The variable is read when the library loads.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

# Open3D ships an old TBB, which Numba warns about before it takes another thread layer: exclude TBB from its search.
os.environ.setdefault("NUMBA_THREADING_LAYER_PRIORITY", "omp tbb workqueue")

drop_stale(Path(__file__).parent)

if TYPE_CHECKING:
    from radarsim.api import simulate as simulate

__all__ = ["simulate"]


def __getattr__(name: str) -> object:
    """`simulate`, imported on first use."""
    if name not in __all__:
        raise AttributeError(f"module 'radarsim' has no attribute {name!r}")
    from radarsim.api import simulate

    globals()[name] = simulate
    return simulate
