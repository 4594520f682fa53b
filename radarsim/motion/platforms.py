"""The carriers of the sensor (`platforms.yaml`): a hand, a cart, a small robot."""

from dataclasses import dataclass

import numpy as np

from radarize.io.yamlfile import read_beside
from radarsim.world.clearance import LOWEST


@dataclass(frozen=True)
class Vibration:
    """Random displacement of a carrier in each of the three axes, with a spectrum that falls by 1 / f^2 in a band.

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
        vibration: of the wheels, or of the hand.
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
    vibration: Vibration
    bob: float = 0.0
    sway: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tremor: float = 0.0
    free_heading: bool = False

    @property
    def body(self) -> tuple[float, float]:
        """Lowest and highest point above the ground, m: everything between is an obstacle."""
        return LOWEST, self.top


def _platform(about: dict) -> Platform:
    angles = {name: np.deg2rad(about[name]) for name in ("turn_rate", "tilt", "tremor")}
    levels = {key: 1e-3 * value for key, value in about["vibration"].items() if key != "band"}
    vibration = Vibration(tuple(about["vibration"]["band"]), **levels)
    sway = tuple(np.deg2rad(about.get("sway", (0.0, 0.0, 0.0))))
    return Platform(**about | angles | {"sway": sway, "vibration": vibration})


PLATFORMS = {name: _platform(about) for name, about in read_beside(__file__).items()}
