"""Odometry by name: which estimators of velocity and turns work together."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from radarize.errors import InputError
from radarize.nets.weights import shipped
from radarize.odometry.doppler import DopplerVelocity
from radarize.odometry.fused import FusedVelocity
from radarize.odometry.integration import Odometry
from radarize.odometry.learned import LearnedRotation, LearnedVelocity
from radarize.odometry.rotation import MapRotation, RotationSettings
from radarize.radar.config import RadarConfig
from radarize.training.maps import MapMaker


class Weights:
    """Where the networks' weights lie.

    Args:
        folder: with ``translation.safetensors`` and so on, as `radarize train` writes them; the shipped ones if None.
    """

    def __init__(self, folder: Path | None = None):
        self.folder = folder

    def of(self, kind: str) -> Path:
        """File of a network."""
        return shipped(kind) if self.folder is None else self.folder / f"{kind}.safetensors"


def doppler(config: RadarConfig, maker: MapMaker, weights: Weights) -> Odometry:
    """Least squares over Doppler peaks, and matching against a local map: no networks."""
    return Odometry(config)


def learned(config: RadarConfig, maker: MapMaker, weights: Weights) -> Odometry:
    """Networks alone (the paper)."""
    velocity = LearnedVelocity(maker, weights.of("translation"))
    return Odometry(config, velocity, LearnedRotation(maker, weights.of("rotation")))


def fused(config: RadarConfig, maker: MapMaker, weights: Weights) -> Odometry:
    """Both: velocities by their covariances, and the map matched from where the network says that it has turned to."""
    learned = LearnedVelocity(maker, weights.of("translation"))
    velocity = FusedVelocity(learned, DopplerVelocity(maker.heatmaps))
    # A map that lags in a turn misleads many matches alike: beside the network each must claim more than its own noise.
    settings = RotationSettings(yaw_noise=np.radians(0.8))
    rotation = MapRotation(maker.heatmaps, settings, LearnedRotation(maker, weights.of("rotation")))
    return Odometry(config, velocity, rotation)


#: Odometry by name.
ODOMETRY: dict[str, Callable[[RadarConfig, MapMaker, Weights], Odometry]] = {
    "doppler": doppler,
    "learned": learned,
    "fused": fused,
}


def make_odometry(name: str, maker: MapMaker, weights: Weights | None = None) -> Odometry:
    """Odometry by a key of `ODOMETRY`.

    Args:
        name: of the method.
        maker: of the radar's maps.
        weights: of the networks; the shipped ones if None.

    Raises:
        InputError: unknown name, or the networks do not fit the radar.
    """
    if name not in ODOMETRY:
        raise InputError(f"odometry is {name!r}, expected one of {', '.join(ODOMETRY)}")
    return ODOMETRY[name](maker.heatmaps.config, maker, weights or Weights())
