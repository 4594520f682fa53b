"""Platforms that carry the sensor (`platforms.yaml`): handheld, cart, robot."""

from dataclasses import dataclass

import numpy as np

from radarize.io.yamlfile import read_beside
from radarsim.world.clearance import LOWEST


@dataclass(frozen=True)
class Vibration:
    """Random displacement of a platform in each axis, with a spectrum proportional to 1 / f^2 within a band.

    Attributes:
        band: lowest and highest frequency, Hz.
        rest: RMS displacement at any speed, m.
        rolling: RMS displacement at 1 m/s, m; its variance grows in proportion to the speed.
    """

    band: tuple[float, float]
    rest: float = 0.0
    rolling: float = 0.0


@dataclass(frozen=True)
class Platform:
    """Platform that carries the sensor.

    Attributes:
        height: height of the sensor, m.
        top: highest point of the carrier, m.
        radius: clearance of the carrier's centre, m; the sensor's own clearance is checked as well.
        footprint: radius of the carrier itself, m.
        speed: usual speed, m/s; slower in curves.
        unsteadiness: standard deviation of the usual speed, relative to it.
        top_speed: maximum speed, m/s.
        acceleration: maximum, along and across, m/s^2.
        turn_rate: maximum, rad/s.
        smoothing: time over which acceleration is smoothed, s.
        reversing: probability that a short way back is driven backward instead of turning round.
        lever_arm: of the sensor ahead of the carrier's axis, m.
        tilt: of the sensor's mount in pitch and roll, standard deviation, rad.
        bob: amplitude of the gait at 1 m/s, m; zero on wheels.
        sway: amplitude of the gait in roll, pitch, yaw, rad.
        tremor: slow random roll and pitch, standard deviation, rad.
        vibration: vibration of wheels or hand.
        free_heading: whether the heading may differ from the direction of motion.
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
    vibration: Vibration
    bob: float = 0.0
    sway: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tremor: float = 0.0
    free_heading: bool = False

    @property
    def body(self) -> tuple[float, float]:
        """Lowest and highest point above the ground, m; everything between is an obstacle."""
        return LOWEST, self.top


def _platform(about: dict) -> Platform:
    angles = {name: np.deg2rad(about[name]) for name in ("turn_rate", "tilt", "tremor")}
    levels = {key: 1e-3 * value for key, value in about["vibration"].items() if key != "band"}
    vibration = Vibration(tuple(about["vibration"]["band"]), **levels)
    sway = tuple(np.deg2rad(about.get("sway", (0.0, 0.0, 0.0))))
    return Platform(**about | angles | {"sway": sway, "vibration": vibration})


PLATFORMS = {name: _platform(about) for name, about in read_beside(__file__).items()}
