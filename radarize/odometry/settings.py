"""Settings of odometry that uses the networks, alone or together with the classical estimators."""

import numpy as np

from radarize.io.plain import Frozen, setting


class FusionConfig(Frozen):
    """Fusion of two velocity estimates from the same samples (`radarize.odometry.fused`)."""

    correlation: float = setting(
        0.06, "correlation of the errors of both estimates, each normalised by its own covariance; fitted on data set "
        "odometry-choice, six walks of 20 s (handheld, cart and robot in buildings A and B of seed 201)", ge=0, lt=1
    )  # fmt: skip
    sure: float = setting(
        0.03, "m/s; where the standard deviation of least squares on the whole array is smaller, the network is not "
        "evaluated; half of it gives no better results on 20 walks of 60 s", ge=0
    )  # fmt: skip
    gate: float = setting(
        9.0, "squared Mahalanobis distance between both estimates above which the covariance is inflated", gt=0
    )


class TurnConfig(Frozen):
    """Yaw increments by the network over several frame spacings (`radarize.odometry.learned`)."""

    spacings: tuple[int, ...] = setting(
        (1, 2, 4), "frame spacings over which yaw increments are estimated, in frames of the network; those that the "
        "network was not trained on are left out", min_length=1
    )  # fmt: skip
    wander: float = setting(
        np.radians(66.0), "rad/s^1.5, random walk of the yaw rate of a handheld radar: its standard deviation after 1 "
        "s", gt=0
    )  # fmt: skip
    fastest: float = setting(np.radians(60.0), "rad/s, standard deviation of the yaw rate before any measurement", gt=0)
    alike: float = setting(
        4.0, "factor on the growth of the variance of the yaw, because the network's errors are correlated from frame "
        "to frame; chosen on seven walks of 60 s (handheld in A to D of seeds 301 to 304, cart in A, and two in the "
        "office), where NEES over 10 s was 0.7 to 5", ge=1
    )  # fmt: skip
