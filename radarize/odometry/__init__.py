"""Radar odometry: ``radarize.odometry(recording)`` is `radarize.estimate_odometry`; the modules here are its parts.

Example:
    >>> odometry = rz.odometry(rec, method="doppler")
    >>> len(odometry), odometry.velocity.shape  # m/s
    (24, (24, 2))
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
