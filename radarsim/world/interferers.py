"""Other radars that transmit in a scene, such as another robot's or a neighbour's.

A scene file lists them:

    interferers:
      - {name: neighbour, radar: long-range, position: [6, 2, 1], yaw: 180}
      - {name: robot, radar: {slope: 70e12, idle_time: 90e-6}, position: [9, 1, 0.5], velocity: [-0.5, 0, 0]}

`radarsim.receiver.interference` computes their effect.
"""

from typing import Annotated

import numpy as np
from jaxtyping import Float
from pydantic import Field, field_validator
from scipy.spatial.transform import Rotation

from radarize.io.schema import Changes
from radarize.io.yamlfile import changed
from radarize.radar.config import RadarConfig
from radarize.radar.presets import PRESETS
from radarsim.world.fields import Name, Strict

Number = Annotated[float, Field(ge=-1e4, le=1e4)]
Vector = tuple[Number, Number, Number]


class Interferer(Strict):
    """Interfering radar. Its antennas and transmit power are those of the radar that it disturbs.

    Attributes:
        name: unique name of the radar.
        radar: name of a preset, or the fields of `RadarConfig` in which it differs from the preset `radarize`.
        position: x, y, z at time 0 of the motion, m.
        velocity: velocity, m/s.
        yaw: direction of its boresight, degrees.
        start: start of its first frame, s; from then on it transmits frame after frame.
        clock_ppm: frequency offset of its clock to that of the disturbed radar, ppm.
    """

    name: Name
    radar: Annotated[RadarConfig, Changes(RadarConfig, tuple(PRESETS))] = Field(
        PRESETS["radarize"], json_schema_extra={"default": "radarize"}
    )
    position: Vector
    velocity: Vector = (0.0, 0.0, 0.0)
    yaw: Number = 0.0
    start: Number = 0.0
    clock_ppm: Annotated[float, Field(ge=-1000, le=1000)] = 0.0

    @field_validator("radar", mode="before")
    @classmethod
    def _named(cls, radar: object) -> object:
        if isinstance(radar, dict):
            return changed(PRESETS["radarize"], radar)
        if isinstance(radar, str) and radar not in PRESETS:
            raise ValueError(f"expected one of the presets {', '.join(PRESETS)}, or fields of a configuration")
        return PRESETS[radar] if isinstance(radar, str) else radar

    def places(self, times: Float[np.ndarray, "*n"] | float) -> Float[np.ndarray, "*n 3"]:
        """Position of the board at times, s; m."""
        return np.asarray(self.position) + np.multiply.outer(times, self.velocity)

    @property
    def rotation(self) -> Float[np.ndarray, "3 3"]:
        """Board-to-world rotation."""
        return Rotation.from_euler("z", self.yaw, degrees=True).as_matrix()
