"""The methods, put together."""

from radarize.mapping.scans import HeatmapScans
from radarize.methods.method import Inputs
from radarize.odometry.doppler import DopplerVelocity
from radarize.odometry.integration import Odometry
from radarize.odometry.rotation import MapRotation


def doppler(inputs: Inputs) -> Odometry:
    """Least squares over Doppler peaks, and matching against a local map."""
    settings, heatmaps = inputs.configuration, inputs.signal.heatmaps
    velocity, rotation = DopplerVelocity(heatmaps, settings.doppler), MapRotation(heatmaps, settings.rotation)
    return Odometry(inputs.radar, velocity, rotation, settings.velocity)


def scans(inputs: Inputs, method: str) -> HeatmapScans:
    """Echoes of heat maps, by a key of `radarize.mapping.scans.METHODS`."""
    return HeatmapScans(inputs.signal.heatmaps, method, inputs.configuration.scans)
