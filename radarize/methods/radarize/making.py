"""The methods, put together."""

import numpy as np

from radarize.methods.method import Inputs
from radarize.methods.radarize.fused import FusedVelocity
from radarize.methods.radarize.learned import LearnedRotation, LearnedVelocity
from radarize.methods.radarize.scans import Segmentation
from radarize.odometry.doppler import DopplerVelocity
from radarize.odometry.integration import Odometry
from radarize.odometry.rotation import MapRotation, RotationSettings


def learned(inputs: Inputs) -> Odometry:
    """Networks alone (the paper)."""
    radar, weights = inputs.radar, inputs.weights
    velocity = LearnedVelocity(radar, weights.of("translation"))
    return Odometry(radar, velocity, LearnedRotation(radar, weights.of("rotation")))


def fused(inputs: Inputs) -> Odometry:
    """Both: velocities by their covariances, and the map matched from where the network says that it has turned to."""
    radar, weights, heatmaps = inputs.radar, inputs.weights, inputs.signal.heatmaps
    velocity = FusedVelocity(LearnedVelocity(radar, weights.of("translation")), DopplerVelocity(heatmaps))
    # A map that lags in a turn misleads many matches alike: beside the network each must claim more than its own noise.
    settings = RotationSettings(yaw_noise=np.radians(0.8))
    rotation = MapRotation(heatmaps, settings, LearnedRotation(radar, weights.of("rotation")))
    return Odometry(radar, velocity, rotation)


def segmentation(inputs: Inputs, first: bool = True) -> Segmentation:
    """The network's first surfaces, or its likeliest cells."""
    return Segmentation(inputs.radar, inputs.weights.of("segmentation"), first=first)
