"""What may be set where networks tell motion, beside the classical estimators or alone."""

import numpy as np
from pydantic import Field

from radarize.plain import Frozen


class FusionConfig(Frozen):
    """Two estimates of the same samples (`radarize.methods.radarize.fused`)."""

    correlation: float = Field(
        0.06,
        ge=0,
        lt=1,
        description="of the errors of both, each in units of its own claims; fitted on data set odometry-choice, six "
        "walks of 20 s (by hand, cart and robot in A and B of seed 201)",
    )
    gate: float = Field(
        9.0, gt=0, description="squared Mahalanobis distance between the two from which covariances grow"
    )


class TurnConfig(Frozen):
    """Turns by the network over several spacings (`radarize.methods.radarize.learned`)."""

    spacings: tuple[int, ...] = Field(
        (1, 2, 4),
        min_length=1,
        description="of the network's frames, over which turns are measured; of these, the ones it was trained on",
    )
    wander: float = Field(
        np.radians(66.0), gt=0, description="rad/s^1.5, by how much the turning rate of a handheld radar wanders in 1 s"
    )
    fastest: float = Field(np.radians(60.0), gt=0, description="rad/s, standard deviation of a rate not known at all")
