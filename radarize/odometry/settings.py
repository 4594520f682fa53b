"""What may be set where networks tell motion, beside the classical estimators or alone."""

import numpy as np

from radarize.io.plain import Frozen, setting


class FusionConfig(Frozen):
    """Two estimates of the same samples (`radarize.odometry.fused`)."""

    correlation: float = setting(
        0.06, "of the errors of both, each in units of its own claims; fitted on data set odometry-choice, six walks "
        "of 20 s (by hand, cart and robot in A and B of seed 201)", ge=0, lt=1
    )  # fmt: skip
    sure: float = setting(
        0.03, "m/s; where a whole array's least squares claim less, the network is not asked; on 20 walks of a minute "
        "half of it is no better", ge=0
    )  # fmt: skip
    gate: float = setting(9.0, "squared Mahalanobis distance between the two from which covariances grow", gt=0)


class TurnConfig(Frozen):
    """Turns by the network over several spacings (`radarize.odometry.learned`)."""

    spacings: tuple[int, ...] = setting(
        (1, 2, 4), "of the network's frames, over which turns are measured; of these, the ones it was trained on",
        min_length=1
    )  # fmt: skip
    wander: float = setting(
        np.radians(66.0), "rad/s^1.5, by how much the turning rate of a handheld radar wanders in 1 s", gt=0
    )
    fastest: float = setting(np.radians(60.0), "rad/s, standard deviation of a rate not known at all", gt=0)
    alike: float = setting(
        4.0, "by how much more the variance of a long turn grows than the network says of each short one, whose errors "
        "are alike; chosen on seven walks of 60 s (by hand in A to D of seeds 301 to 304, by cart in A, and two in the "
        "office), where what it said of 10 s had NEES of 0.7 to 5", ge=1
    )  # fmt: skip
