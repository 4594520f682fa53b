"""The methods, put together."""

import numpy as np
from jaxtyping import Float
from torch import nn

from radarize.errors import InputError
from radarize.methods.method import Inputs
from radarize.methods.published.maps import PublishedMaps, PublishedStream
from radarize.methods.published.networks import (
    PublishedRotationNet,
    PublishedSegmentationNet,
    PublishedTranslationNet,
)
from radarize.methods.published.odometry import CHAINS, PublishedOdometry
from radarize.methods.published.scans import PublishedScans
from radarize.nets.weights import Network, load
from radarize.tum import planar


def odometry(inputs: Inputs) -> PublishedOdometry:
    """Like the artefact, from true headings where the recording has them."""
    nets = (_load(inputs, network) for network in (PublishedTranslationNet, PublishedRotationNet))
    return PublishedOdometry(inputs.part(PublishedStream), *nets, _headings(inputs))


def scans(inputs: Inputs) -> PublishedScans:
    """By the artefact's segmentation."""
    return PublishedScans(inputs.part(PublishedStream), _load(inputs, PublishedSegmentationNet))


def _load(inputs: Inputs, network: type[Network]) -> nn.Module:
    if inputs.weights.folder is None:
        raise InputError(
            "published odometry and scans come without weights: train them (`radarize train published-translation` and "
            "so on) and name their folder with --weights"
        )
    return load(inputs.weights.of(f"published-{network.kind}"), network, inputs.radar)[0]


def _headings(inputs: Inputs) -> Float[np.ndarray, "4"] | None:
    """True yaws of the first frames that are used."""
    source = inputs.recording
    if source is None or not source.has("truth/pose"):
        return None
    stride = PublishedMaps.stride(inputs.radar)
    yaws = planar(source.rows("truth/pose", 0, CHAINS * stride)[::stride])[:, 2]
    return yaws if len(yaws) == CHAINS and np.isfinite(yaws).all() else None
