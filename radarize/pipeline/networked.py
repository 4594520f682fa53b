"""Methods with Radarize's networks, alone or combined with Doppler least squares."""

from functools import partial

from radarize.learning.nets.motion import TranslationNet
from radarize.learning.nets.weights import header_of
from radarize.odometry.doppler import DopplerVelocity
from radarize.odometry.fused import FusedVelocity
from radarize.odometry.integration import Odometry, VelocityEstimator
from radarize.odometry.learned import LearnedRotation, LearnedVelocity
from radarize.odometry.rotation import MapRotation
from radarize.pipeline.method import Inputs, Method
from radarize.radar.array import is_whole
from radarize.scans.extraction import HeatmapScans
from radarize.scans.segmentation import SegmentationScans


def learned(inputs: Inputs) -> Odometry:
    """Make odometry from the networks alone, as in the paper."""
    velocity = LearnedVelocity(inputs.radar, inputs.weights.of("translation"))
    return Odometry(inputs.radar, velocity, _turns(inputs), inputs.configuration.velocity)


def fused(inputs: Inputs) -> Odometry:
    """Make odometry from networks and classical methods.

    Velocities are fused by their covariances; the map is matched around the rotation that the network estimates.

    Least squares need the network where the array measures no elevation or has short rows. With an IWR6843AOP, mean ATE
    of odometry is 0.53 m without the network and 0.21 m with it; with two transmitters it is 0.10 m and 0.08 m, on six
    walks of 20 s among five people. With a whole array, there and on 20 walks of 60 s, the network gains nothing on
    average (`benchmark.choices.ARRAYS`), and is used only for frames in which the covariance of least squares is large.
    """
    settings, heatmaps = inputs.configuration, inputs.signal.heatmaps
    doppler = DopplerVelocity(heatmaps, settings.doppler)
    rotation = MapRotation(heatmaps, settings.rotation, _turns(inputs))
    whole, weights = is_whole(inputs.radar), inputs.weights.of("translation")
    velocity: VelocityEstimator = doppler
    if not (whole and header_of(weights).difference(inputs.radar, TranslationNet.maker)):
        velocity = FusedVelocity(LearnedVelocity(inputs.radar, weights), doppler, settings.fusion, always=not whole)
    return Odometry(inputs.radar, velocity, rotation, settings.velocity)


def _turns(inputs: Inputs) -> LearnedRotation:
    return LearnedRotation(inputs.radar, inputs.weights.of("rotation"), inputs.configuration.turns)


def segmentation(inputs: Inputs, first: bool = True) -> SegmentationScans:
    """Make scans from the network's first surfaces, or its most likely cells; beyond its range from first echoes."""
    far = HeatmapScans(inputs.signal.heatmaps, "first-echo", inputs.configuration.scans) if first else None
    return SegmentationScans(inputs.radar, inputs.weights.of("segmentation"), first, far)


FUSED = Method("networks and Doppler", fused, ("translation", "rotation"), whole=("rotation",))
LEARNED = Method("networks", learned, ("translation", "rotation"))
SEGMENTATION = Method("segmentation network, first echo", segmentation, ("segmentation",))
SEGMENTATION_ALONE = Method("segmentation network alone", partial(segmentation, first=False), ("segmentation",))
