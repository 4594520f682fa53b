"""Radar odometry. Call it as ``radarize.odometry(recording)``, see `radarize.estimate_odometry`.

`integration.Odometry` is the algorithm. It takes velocities from `doppler`, `learned` or `fused`, and yaw increments
from `rotation` or `learned`; `uncertainty` is its error model.
"""

import sys
from types import ModuleType
from typing import Any


class _Odometry(ModuleType):
    """A callable package. Importing one of its modules replaces the function `radarize.odometry` by this package, so
    the package forwards calls to that function."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Estimate odometry, see `radarize.estimate_odometry`."""
        import radarize

        return radarize.estimate_odometry(*arguments, **options)


sys.modules[__name__].__class__ = _Odometry
