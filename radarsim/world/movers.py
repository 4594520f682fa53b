"""Moving objects: people who walk, doors that open, fans that turn.

A mover is a set of rigid parts, each a capsule or a box in its own frame, with a pose at any time. Its surface
carries scatterers, and the parts obstruct other echoes; parts with a material reflect and transmit like
static objects of that material. A scene file lists them:

    moving:
      - {kind: person, name: visitor, path: [[1, 0], [4, 0]], speed: 1.1}
      - {kind: door, name: exit, hinge: [5, 1, 1], width: 0.9, height: 2, angles: [0, 80], period: 4, material: wood}
      - {kind: fan, name: fan, center: [2, 2, 2.2], radius: 0.5, turns_per_second: 1}
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from jaxtyping import Float
from pydantic import Field, field_validator, model_validator
from scipy.spatial.transform import Rotation

from radarize.io.errors import InputError
from radarsim.world import shapes
from radarsim.world.fields import Length, Name, Number, Strict
from radarsim.world.fields import Vector as Point
from radarsim.world.materials import Material, MaterialName, material
from radarsim.world.objects import SceneObject


@dataclass(frozen=True)
class Part:
    """A rigid part in its own frame, centred at the origin.

    Attributes:
        half: half extents along x, y, z of a box, m; of a capsule: (radius, radius, half length of the axis, along z).
        capsule: a capsule, else a box.
        material: of a box that acts like a static object; None: scatterers share the mover's cross section.
    """

    half: tuple[float, float, float]
    capsule: bool
    material: Material | None = None

    @property
    def object(self) -> SceneObject | None:
        """Part with a material as an object at the origin."""
        if self.material is None:
            return None
        return SceneObject("part", shapes.box((0, 0, 0), [2 * x for x in self.half]), self.material)

    @property
    def area(self) -> float:
        """Surface area, m^2."""
        x, y, z = self.half
        return 4 * np.pi * x * (x + z) if self.capsule else 8 * (x * y + y * z + z * x)

    def sample(self, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Random points (count, 3) with uniform density on the surface, and outward normals."""
        x, y, z = self.half
        if self.capsule:
            # A sphere, split at its equator: each half keeps its fraction of the area.
            straight = rng.random(count) < z / (x + z)
            normal = rng.normal(size=(count, 3))
            normal[straight, 2] = 0
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
            offset = np.where(straight, rng.uniform(-z, z, count), np.sign(normal[:, 2]) * z)
            return x * normal + offset[:, None] * [0, 0, 1], normal
        faces = np.array([y * z, y * z, z * x, z * x, x * y, x * y])
        face = rng.choice(6, count, p=faces / faces.sum())
        axis, side = face // 2, np.where(face % 2, 1.0, -1.0)
        point = rng.uniform(-1, 1, (count, 3)) * self.half
        normal = np.zeros((count, 3))
        normal[np.arange(count), axis] = side
        point[np.arange(count), axis] = side * np.asarray(self.half)[axis]
        return point, normal


class Mover(Strict, ABC):
    """Moving object. A subclass with its own `kind` can be used in scene files.

    Parts of no material share the mover's `cross_section`, m^2; where it has none, they hide and do not echo.

    Attributes:
        name: unique name of the mover.
        kind: type of mover.
    """

    name: Name

    @abstractmethod
    def parts(self) -> list[Part]:
        """Rigid parts of the mover."""

    @abstractmethod
    def poses(self, t: Float[np.ndarray, "n"]) -> tuple[Float[np.ndarray, "n part 3 3"], Float[np.ndarray, "n part 3"]]:
        """Rotation (part to world) and centre (m) of every part at times t, s."""


class Person(Mover):
    """Person who walks to and fro along a polyline, swinging all limbs.

    Ten capsules: trunk, head, upper and lower limbs. Hips and shoulders swing as sines at the step frequency,
    knees bend in the swing phase, after the averages of Murray, Drought and Kory (J. Bone Joint Surg. 46-A,
    1964). Cross section: 0 to -8 dBsm is measured for pedestrians at 76 GHz (Yamada, Tanaka and Nishikawa, EuRAD 2005).

    Attributes:
        cross_section: radar cross section of the whole body, m^2.
        path: way-points x, y of the polyline, m; one point: the person stands there.
        speed: walking speed, m/s.
        height: height of the body, m.
        floor: z of the floor, m.
    """

    kind: Literal["person"] = "person"
    cross_section: Length = 0.5
    path: tuple[tuple[Number, Number], ...] = Field(min_length=1)
    speed: Annotated[float, Field(ge=0, le=3, allow_inf_nan=False)] = 1.0
    height: Annotated[float, Field(gt=0.5, lt=2.5)] = 1.75
    floor: Number = 0.0

    def parts(self) -> list[Part]:
        """Trunk, head; then right and left thigh, shin, upper arm, forearm."""
        h = self.height
        sizes = ((0.042, 0.08), (0.03, 0.09), (0.026, 0.065), (0.022, 0.06))
        limb = [Part((radius * h, radius * h, half * h), True) for radius, half in sizes]
        return [Part((0.09 * h, 0.09 * h, 0.1 * h), True), Part((0.055 * h, 0.055 * h, 0.02 * h), True), *limb, *limb]

    def poses(self, t: Float[np.ndarray, "n"]) -> tuple[Float[np.ndarray, "n part 3 3"], Float[np.ndarray, "n part 3"]]:
        """Rotation and centre of every part."""
        t = np.asarray(t, float)
        h = self.height
        place, heading = self._walk(t)
        moving = min(self.speed / 1.3, 1.2) if len(self.path) > 1 else 0.0
        # A cycle is two steps; its length grows with speed: 1.4 m per cycle at 1.3 m/s.
        phase = 2 * np.pi * t * self.speed / (1.4 * np.sqrt(max(self.speed, 0.1) / 1.3))
        yaw = Rotation.from_rotvec(heading[:, None] * [0.0, 0.0, 1.0])
        pelvis = np.column_stack([place, self.floor + 0.53 * h + 0.02 * moving * np.cos(2 * phase)])
        shoulder = pelvis + [0, 0, 0.29 * h]
        turns, centers = [yaw, yaw], [pelvis + [0, 0, 0.16 * h], pelvis + [0, 0, 0.41 * h]]
        for side, offset in ((-1, 0.0), (1, np.pi)):
            swing = np.sin(phase + offset)
            hip = np.deg2rad(25) * moving * swing
            knee = np.deg2rad(5) + np.deg2rad(50) * moving * np.clip(np.cos(phase + offset), 0, None) ** 2
            arm = -np.deg2rad(20) * moving * swing
            elbow = np.deg2rad(15) + np.deg2rad(15) * moving * (1 - swing) / 2
            for root, across, first, second, upper, lower in (
                (pelvis, 0.055 * h, hip, hip - knee, 0.245 * h, 0.246 * h),
                (shoulder, 0.11 * h, arm, arm + elbow, 0.186 * h, 0.18 * h),
            ):
                joint = root + yaw.apply(np.tile([0.0, side * across, 0.0], (len(t), 1)))
                for angle, length in ((first, upper), (second, lower)):
                    # Positive angles carry the limb's lower end forward.
                    turn = yaw * Rotation.from_rotvec(-angle[:, None] * [0.0, 1.0, 0.0])
                    end = joint + turn.apply([0.0, 0.0, -length])
                    turns.append(turn)
                    centers.append((joint + end) / 2)
                    joint = end
        return np.stack([r.as_matrix() for r in turns], axis=1), np.stack(centers, axis=1)

    def _walk(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position (n, 2) and heading along the polyline, back and forth.

        Both are means over a section of the path, so corners are rounded and a turn-around takes nearly a metre.
        """
        path = np.asarray(self.path, float)
        tour = np.concatenate([path, path[-2::-1]])
        segments = np.diff(tour, axis=0)
        steps = np.linalg.norm(segments, axis=1)
        if not steps.sum():
            return np.tile(path[0], (len(t), 1)), np.zeros(len(t))
        segments, steps = segments[steps > 0], steps[steps > 0]
        along = np.concatenate([[0], np.cumsum(steps)])
        bearing = np.arctan2(segments[:, 1], segments[:, 0])
        turns = np.pi - (np.pi - np.diff(bearing, append=bearing[0]) + 1e-9) % (2 * np.pi)  # about-turns: left
        heading = bearing[0] + np.concatenate([[0], np.cumsum(turns)])

        def over(half: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            distance = self.speed * t[:, None] + half * np.linspace(-1, 1, 201)
            weight = np.hanning(203)[1:-1]
            return distance // along[-1], distance % along[-1], weight / weight.sum()

        _, part, weight = over(0.25)
        place = np.stack([np.interp(part, along, np.append(tour[0, i], tour[0, i] + np.cumsum(segments[:, i]))) @ weight
                          for i in (0, 1)], axis=-1)  # fmt: skip
        lap, part, weight = over(0.45)
        segment = np.clip(np.searchsorted(along, part, side="right") - 1, 0, len(segments) - 1)
        # A tabulated step would be discontinuous; a turn is spread over a fifth of a metre before it is averaged.
        into = np.clip((part - along[segment]) / 0.2, 0, 1)
        before = np.where(segment > 0, heading[np.maximum(segment - 1, 0)], heading[-2] - (heading[-1] - heading[0]))
        bearing = before + into * (heading[segment] - before) + lap * (heading[-1] - heading[0])
        return place, bearing @ weight


class Door(Mover):
    """A leaf of a material that swings about a vertical hinge between two angles, as a sine.

    Attributes:
        hinge: x, y, z of the hinge at half its height, m.
        width: width of the leaf, m.
        height: height of the leaf, m.
        thickness: thickness of the leaf, m.
        angles: first and last angle of the leaf from the x axis, degrees.
        period: period of the swing, s.
        material: name of the leaf's material.
    """

    kind: Literal["door"] = "door"
    hinge: Point  # at half its height
    width: Length = 0.9
    height: Length = 2.0
    thickness: Length = 0.04
    angles: tuple[Number, Number] = (0.0, 90.0)
    period: Length = 4.0
    material: MaterialName = "wood"

    @field_validator("material")
    @classmethod
    def _is_known(cls, name: str) -> str:
        try:
            material(name)
        except InputError as error:
            raise ValueError(str(error)) from error
        return name

    def parts(self) -> list[Part]:
        """The door leaf as a rigid part."""
        return [Part((self.width / 2, self.thickness / 2, self.height / 2), False, material(self.material))]

    def poses(self, t: Float[np.ndarray, "n"]) -> tuple[Float[np.ndarray, "n part 3 3"], Float[np.ndarray, "n part 3"]]:
        """Rotation and centre of the leaf."""
        low, high = np.deg2rad(self.angles)
        angle = (low + high) / 2 - (high - low) / 2 * np.cos(2 * np.pi * np.asarray(t, float) / self.period)
        turn = Rotation.from_rotvec(angle[:, None] * [0.0, 0.0, 1.0])
        return turn.as_matrix()[:, None], (np.asarray(self.hinge) + turn.apply([self.width / 2, 0, 0]))[:, None]


class Fan(Mover):
    """Blades that turn about an axis.

    Attributes:
        cross_section: radar cross section of all blades, m^2.
        center: x, y, z of the centre, m.
        axis: direction of the axis, x, y, z.
        radius: radius, m.
        blades: number of blades.
        pitch: pitch of the blades, degrees.
        turns_per_second: rotations per second.
    """

    kind: Literal["fan"] = "fan"
    cross_section: Length = 0.05
    center: Point
    axis: Point = (0.0, 0.0, 1.0)
    radius: Length = 0.5
    blades: Annotated[int, Field(ge=1, le=12)] = 3
    pitch: Number = 20.0
    #: Path lengths within a burst are parabolas: exact to 0.1 mm up to about two turns a second at half a metre.
    turns_per_second: Annotated[float, Field(ge=-2, le=2, allow_inf_nan=False)] = 1.0

    @model_validator(mode="after")
    def _has_axis(self) -> "Fan":
        if not np.any(self.axis):
            raise ValueError("axis is (0, 0, 0), expected a direction")
        return self

    def parts(self) -> list[Part]:
        """The blades as rigid parts."""
        return [Part((0.45 * self.radius, 0.08 * self.radius, 0.004), False)] * self.blades

    def poses(self, t: Float[np.ndarray, "n"]) -> tuple[Float[np.ndarray, "n part 3 3"], Float[np.ndarray, "n part 3"]]:
        """Rotation and centre of every blade."""
        turns = self.turns_per_second * np.asarray(t, float)[:, None] + np.arange(self.blades) / self.blades
        angle = 2 * np.pi * turns
        upright, _ = Rotation.align_vectors([self.axis], [[0, 0, 1]])
        turn = np.zeros((*angle.shape, 3))
        turn[..., 2] = angle
        spin = upright * Rotation.from_rotvec(turn.reshape(-1, 3))
        blade = (spin * Rotation.from_euler("x", self.pitch, degrees=True)).as_matrix().reshape(*angle.shape, 3, 3)
        center = spin.apply([0.55 * self.radius, 0, 0]).reshape(*angle.shape, 3)
        return blade, np.asarray(self.center) + center


def poses(
    movers: list[Mover], t: Float[np.ndarray, "n"]
) -> tuple[Float[np.ndarray, "n part 3 3"], Float[np.ndarray, "n part 3"]]:
    """Rotation and centre of every part of every mover at times, s."""
    if not movers:
        return np.zeros((len(t), 0, 3, 3)), np.zeros((len(t), 0, 3))
    each = [mover.poses(t) for mover in movers]
    return np.concatenate([p[0] for p in each], axis=1), np.concatenate([p[1] for p in each], axis=1)
