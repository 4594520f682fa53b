"""Settings of velocities and turns estimated with networks."""

import numpy as np

from radarize.io.plain import Frozen, setting


class FusionConfig(Frozen):
    """Fusion of the velocities of network and Doppler (`radarize.odometry.fused`)."""

    correlation: float = setting(
        0.06, "correlation of the errors of network and Doppler, each divided by its estimated standard deviation",
        "1", tuned="6 walks of 20 s (ODOMETRY)", ge=0, lt=1
    )  # fmt: skip
    sure: float = setting(
        0.03, "standard deviation of the Doppler velocity of a whole array below which the network is not used",
        "m/s", tuned="20 walks of 60 s: half of it gives the same error", ge=0
    )  # fmt: skip
    gate: float = setting(
        9.0, "squared Mahalanobis distance between the two velocities above which covariances are inflated", "1", gt=0
    )


class TurnConfig(Frozen):
    """Yaw increments by the network over several frame spacings (`radarize.odometry.learned`)."""

    spacings: tuple[int, ...] = setting(
        (1, 2, 4), "spacings over which turns are measured; of these, the ones that the network was trained on",
        "frames of the network", min_length=1
    )  # fmt: skip
    wander: float = setting(
        np.radians(66.0), "random-walk density of the turn rate of a handheld radar", "rad/s^1.5", gt=0
    )
    fastest: float = setting(np.radians(60.0), "standard deviation of an unknown turn rate", "rad/s", gt=0)
    trained: float = setting(
        np.radians(25.0), "standard deviation of the turn rate in training, a prior that draws the network's turns to "
        "zero and is removed from them", "rad/s", tuned="5 walks of 60 s (of FURNISHED), scale of turns", gt=0
    )  # fmt: skip
    variance_factor: float = setting(
        4.0, "factor on the growth of the yaw variance, because errors of consecutive turns are correlated", "1",
        tuned="7 walks of 20 to 60 s (TURNS), NEES over 10 s of 0.7 to 5", ge=1
    )  # fmt: skip
