"""Radar-only odometry, mapping and SLAM on raw I/Q of single-chip mmWave radars.

    import radarize as rz

    rec = rz.load("walk.h5")
    rz.plot(rz.range_azimuth(rec[100]))
    run = rz.run(rec)
    print(rz.evaluate(run))

What stands here is loaded at its first use. ``docs/python.md`` shows it; ``__init__.pyi`` has the types.
"""

from importlib import import_module

#: Of both packages: pyproject.toml takes it from here.
__version__ = "1.1.0.dev0"

#: The face: where each name stands.
_HOMES = {
    "InputError": "radarize.errors",
    "Recording": "radarize.recording",
    "Trajectory": "radarize.trajectory",
    "Evaluation": "radarize.api.evaluation",
    "PointCloud": "radarize.api.points",
    "Run": "radarize.api.run",
    "doppler_azimuth": "radarize.api.maps",
    "estimate_odometry": "radarize.api.odometry",
    "evaluate": "radarize.api.evaluation",
    "live": "radarize.api.live",
    "load": "radarize.api.load",
    "plot": "radarize.api.plot",
    "point_cloud": "radarize.api.points",
    "range_azimuth": "radarize.api.maps",
    "range_doppler": "radarize.api.maps",
    "range_profile": "radarize.api.maps",
    "run": "radarize.api.run",
    "torch_dataset": "radarize.api.learning",
}
__all__ = ["__version__", "odometry", *_HOMES]  # noqa: F822  odometry is a package that can be called


def __getattr__(name: str) -> object:
    if name == "odometry":
        return import_module("radarize.odometry")
    if name not in _HOMES:
        raise AttributeError(f"module 'radarize' has no attribute {name!r}")
    globals()[name] = found = getattr(import_module(_HOMES[name]), name)
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
