"""The three carriers of the sensor: a hand, a cart, a small robot.

Figures after A. Sie et al., "Radarize" (MobiSys 2024), section on data collection: hand and cart up to 1.6 m/s and
over 50 m in about a minute, the hand also backward, sideways and with fast turns, the cart constant and slow in turns;
the robot (an iRobot Create 3, 0.34 m across) up to 0.5 m/s and some 20 m, close to the ground.
"""

from dataclasses import dataclass

import numpy as np

from radarsim.world.clearance import LOWEST


@dataclass(frozen=True)
class Platform:
    """What carries the sensor.

    Attributes:
        height: of the sensor, m.
        top: highest point of the carrier, m.
        radius: clearance of the carrier's middle, m; the sensor's own is checked besides.
        footprint: radius of the carrier itself, m.
        speed: usual, m/s; slower in curves.
        unsteadiness: standard deviation of the usual speed, as a share of it.
        top_speed: never exceeded, m/s.
        acceleration: m/s^2, along and across.
        turn_rate: rad/s.
        smoothing: of accelerations, s.
        reversing: share of the shorter ways back that are done without turning round.
        lever_arm: of the sensor from the carrier's axis, forward, m.
        tilt: of the sensor's mount in pitch and roll, standard deviation, rad.
        bob: amplitude of the gait at 1 m/s, m; zero on wheels.
        sway: amplitude of the gait in roll, pitch, yaw, rad.
        tremor: slow wander of roll and pitch, standard deviation, rad.
        free_heading: may face elsewhere than it goes.
    """

    height: float
    top: float
    radius: float
    footprint: float
    speed: float
    unsteadiness: float
    top_speed: float
    acceleration: float
    turn_rate: float
    smoothing: float
    reversing: float
    lever_arm: float
    tilt: float
    bob: float = 0.0
    sway: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tremor: float = 0.0
    free_heading: bool = False

    @property
    def body(self) -> tuple[float, float]:
        """Lowest and highest point above the ground, m: everything between is an obstacle."""
        return LOWEST, self.top


PLATFORMS: dict[str, Platform] = {
    "handheld": Platform(
        height=1.2, top=1.8, radius=0.40, footprint=0.25, speed=1.1, unsteadiness=0.15, top_speed=1.6,
        acceleration=1.3, turn_rate=np.deg2rad(85), smoothing=0.12, reversing=0.2, lever_arm=0.12,
        tilt=np.deg2rad(2), bob=0.02, sway=(np.deg2rad(2), np.deg2rad(1.5), np.deg2rad(2)), tremor=np.deg2rad(1.2),
        free_heading=True,
    ),
    "cart": Platform(
        height=0.95, top=1.2, radius=0.38, footprint=0.25, speed=1.4, unsteadiness=0.07, top_speed=1.6,
        acceleration=0.8, turn_rate=np.deg2rad(45), smoothing=0.25, reversing=0.35, lever_arm=0.20,
        tilt=np.deg2rad(0.5), tremor=np.deg2rad(0.15),
    ),
    "robot": Platform(
        height=0.20, top=0.45, radius=0.36, footprint=0.17, speed=0.41, unsteadiness=0.12, top_speed=0.5,
        acceleration=0.4, turn_rate=np.deg2rad(45), smoothing=0.15, reversing=0.35, lever_arm=0.10,
        tilt=np.deg2rad(0.5), tremor=np.deg2rad(0.1),
    ),
}  # fmt: skip
