"""Radar-only odometry, mapping and SLAM on raw I/Q of single-chip mmWave radars."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("radarize")
except PackageNotFoundError:  # run from a source tree that was never installed
    __version__ = "0+unknown"
