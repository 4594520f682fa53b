"""Odometry and scans of the published artefact as methods of the pipeline."""

import numpy as np
from jaxtyping import Float

from radarize.baselines.published.artefact import read_artefact
from radarize.baselines.published.maps import PublishedMaps, PublishedStream
from radarize.baselines.published.networks import (
    PublishedRotationNet,
    PublishedSegmentationNet,
    PublishedTranslationNet,
)
from radarize.baselines.published.odometry import CHAINS, PublishedOdometry
from radarize.baselines.published.scans import PublishedScans
from radarize.io.errors import InputError
from radarize.io.tum import planar
from radarize.learning.nets.weights import Network, load
from radarize.pipeline.method import Inputs, Method


def odometry(inputs: Inputs) -> PublishedOdometry:
    """Make the artefact's odometry, which starts from true headings if the recording has them."""
    return PublishedOdometry(
        PublishedStream(inputs.radar), _load(inputs, PublishedTranslationNet), _load(inputs, PublishedRotationNet),
        _headings(inputs),
    )  # fmt: skip


def scans(inputs: Inputs) -> PublishedScans:
    """Make the artefact's scan extraction by segmentation."""
    return PublishedScans(PublishedStream(inputs.radar), _load(inputs, PublishedSegmentationNet))


def _load(inputs: Inputs, network: type[Network]) -> Network:
    if inputs.weights.folder is None:
        raise InputError(
            "published odometry and scans come without weights: train them (`radarize train published-translation` and "
            "so on), or take the artefact's (published-translation.pth and so on), and name their folder with --weights"
        )
    path = inputs.weights.of(f"published-{network.kind}")
    if not path.exists() and (theirs := path.with_suffix(".pth")).exists():
        return read_artefact(theirs, network.kind, inputs.radar)[0]
    return load(path, network, inputs.radar)[0]


def _headings(inputs: Inputs) -> Float[np.ndarray, "4"] | None:
    """Return the true yaws of the first frames that are used; None if unknown."""
    source = inputs.recording
    if source is None or not source.has("truth/pose"):
        return None
    stride, first = PublishedMaps.stride(inputs.radar), PublishedMaps.warmup
    yaws = planar(source.rows("truth/pose", first, first + CHAINS * stride)[::stride])[:, 2]
    return yaws if len(yaws) == CHAINS and np.isfinite(yaws).all() else None


ODOMETRY = Method("as published", odometry, ("published-translation", "published-rotation"))
SCANS = Method("as published", scans, ("published-segmentation",))
