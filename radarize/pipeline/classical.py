"""Methods without networks, for any radar: Doppler least squares with map matching; echoes in Capon heat maps."""

from functools import partial

from radarize.odometry.doppler import DopplerVelocity
from radarize.odometry.integration import Odometry
from radarize.odometry.rotation import MapRotation
from radarize.pipeline.method import Inputs, Method
from radarize.scans.extraction import HeatmapScans


def doppler(inputs: Inputs) -> Odometry:
    """Make odometry from least squares over Doppler peaks and from matching against a local map."""
    settings, heatmaps = inputs.configuration, inputs.signal.heatmaps
    velocity, rotation = DopplerVelocity(heatmaps, settings.doppler), MapRotation(heatmaps, settings.rotation)
    return Odometry(inputs.radar, velocity, rotation, settings.velocity)


def scans(inputs: Inputs, method: str) -> HeatmapScans:
    """Make scans from the echoes in heat maps, by a key of `radarize.scans.extraction.METHODS`."""
    return HeatmapScans(inputs.signal.heatmaps, method, inputs.configuration.scans)


DOPPLER = Method("Doppler least squares", doppler)
ELEVATION_AWARE = Method("elevation-aware first echo", partial(scans, method="elevation-aware"))
FIRST_ECHO = Method("first echo", partial(scans, method="first-echo"))
CFAR = Method("CFAR", partial(scans, method="cfar"))
THRESHOLD = Method("threshold", partial(scans, method="threshold"))
