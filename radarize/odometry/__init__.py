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
    """The package, which is called as the function of the same name: importing a module of it would hide that."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """See `radarize.estimate_odometry`."""
        import radarize

        return radarize.estimate_odometry(*arguments, **options)


sys.modules[__name__].__class__ = _Odometry
