"""Radar-only odometry, mapping and SLAM on raw I/Q of single-chip mmWave radars."""

#: Of both packages: pyproject.toml takes it from here.
__version__ = "1.1.0.dev0"
