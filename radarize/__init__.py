"""Radar-only odometry, mapping and SLAM on raw I/Q of single-chip mmWave radars.

    import radarize as rz

    rec = rz.load("walk.h5")
    rz.plot(rz.range_azimuth(rec[100]))
    run = rz.run(rec)
    print(rz.evaluate(run))

Names are imported at first use. ``docs/howto/python.md`` shows what they do.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from radarize.capture.api import live as live
    from radarize.evaluation.evaluation import Evaluation as Evaluation
    from radarize.evaluation.evaluation import evaluate as evaluate
    from radarize.evaluation.plot import plot as plot
    from radarize.io.errors import InputError as InputError
    from radarize.io.load import load as load
    from radarize.io.recording import Recording as Recording
    from radarize.io.trajectory import Trajectory as Trajectory
    from radarize.learning.torch_dataset import torch_dataset as torch_dataset
    from radarize.pipeline.calibration.calibration import Calibration as Calibration
    from radarize.pipeline.calibration.calibration import calibrate as calibrate
    from radarize.pipeline.check.check import Check as Check
    from radarize.pipeline.check.check import check as check
    from radarize.pipeline.maps import doppler_azimuth as doppler_azimuth
    from radarize.pipeline.maps import range_azimuth as range_azimuth
    from radarize.pipeline.maps import range_doppler as range_doppler
    from radarize.pipeline.maps import range_profile as range_profile
    from radarize.pipeline.odometry import estimate_odometry as estimate_odometry
    from radarize.pipeline.odometry import estimate_odometry as odometry
    from radarize.pipeline.pointcloud import PointCloud as PointCloud
    from radarize.pipeline.pointcloud import point_cloud as point_cloud
    from radarize.pipeline.run import Run as Run
    from radarize.pipeline.run import run as run

#: Version of both packages; pyproject.toml reads it.
__version__ = "1.1.0.dev0"

#: Module of each public name.
_HOMES = {
    "InputError": "io.errors",
    "Recording": "io.recording",
    "Trajectory": "io.trajectory",
    "Calibration": "pipeline.calibration.calibration",
    "Evaluation": "evaluation.evaluation",
    "PointCloud": "pipeline.pointcloud",
    "Run": "pipeline.run",
    "calibrate": "pipeline.calibration.calibration",
    "Check": "pipeline.check.check",
    "check": "pipeline.check.check",
    "doppler_azimuth": "pipeline.maps",
    "estimate_odometry": "pipeline.odometry",
    "evaluate": "evaluation.evaluation",
    "live": "capture.api",
    "load": "io.load",
    "plot": "evaluation.plot",
    "point_cloud": "pipeline.pointcloud",
    "range_azimuth": "pipeline.maps",
    "range_doppler": "pipeline.maps",
    "range_profile": "pipeline.maps",
    "run": "pipeline.run",
    "torch_dataset": "learning.torch_dataset",
}
__all__ = ["__version__", "odometry", *_HOMES]  # noqa: F822  odometry is a package that can be called


def __getattr__(name: str) -> object:
    if name == "odometry":
        return import_module("radarize.odometry")
    if name not in _HOMES:
        raise AttributeError(f"module 'radarize' has no attribute {name!r}")
    globals()[name] = found = getattr(import_module(f"radarize.{_HOMES[name]}"), name)
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
