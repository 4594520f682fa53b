"""Python interface of the simulator: `radarsim.simulate`, which the command `radarsim simulate` calls too."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal, TypedDict, Unpack

import numpy as np
from jaxtyping import Float

from radarize.io.errors import refuse_unknown
from radarize.io.recording import Recording, in_temporary_file
from radarize.radar.config import RadarConfig
from radarsim.motion.trajectory import Mounting
from radarsim.receiver.frontend_config import FrontEndConfig
from radarsim.recording.simulate import simulate as simulate_to
from radarsim.world.scene import Scene


class Plan(TypedDict, total=False):
    """Options of a simulation: those of ``radarsim simulate``, with the defaults of `planned` and `Walk`."""

    platform: Literal["handheld", "cart", "robot"]
    trajectory: Path | None
    waypoints: Path | Float[np.ndarray, "n 2"] | None
    mounting: Mounting | str | None
    duration: float | None
    people: int
    seed: int
    radar: str | RadarConfig
    frontend: Path | FrontEndConfig | None
    sensors: str | Sequence[str]


def simulate(
    scene: str | Path | Scene,
    output: str | Path | None = None,
    *,
    workers: int | None = 1,
    progress: Callable[[int, int], None] | None = None,
    **plan: Unpack[Plan],
) -> Recording:
    """Simulate the recording of a radar that moves through a scene.

    Args:
        scene: name of a scene of the project (``"office"``, ``"stress/corner@2"``), a YAML file, or a `Scene`.
        output: recording to write (``.h5``); by default a temporary file that is deleted with the object.
        workers: number of processes that compute frames; 1: this process only; None: one per core, as in the command. A
            script that uses more than 1 needs an ``if __name__ == "__main__"``.
        progress: called with (frames done, total frames).
        plan: ``platform`` (``"handheld"``, ``"cart"``, ``"robot"``) on a planned tour, or a ``trajectory`` (TUM) or
            ``waypoints`` (m) to follow; ``mounting`` of the sensor (x y z in m, roll pitch yaw in degrees);
            ``duration`` (s; 40 of a tour); ``people`` near the path; ``seed`` (same seed, same bytes); ``radar`` (a
            preset, ``.cfg`` or `RadarConfig`); ``frontend`` (YAML); ``sensors`` beside the radar, as ``"depth,imu"``.

    Returns:
        The recording with its truth, open.

    Raises:
        InputError: unusable scene, configuration, trajectory, way-points, sensor or output.

    Example:
        >>> walk = radarsim.simulate("stress/corner", duration=0.1, seed=3)
        >>> len(walk), walk[0].samples.dtype, walk.attributes["seed"]
        (3, dtype('int16'), 3)
    """
    refuse_unknown(plan, Plan)
    given = dict(plan)
    if isinstance(mounting := given.get("mounting"), str):
        given["mounting"] = Mounting.parse(mounting) if mounting else None
    if isinstance(sensors := given.get("sensors"), str):
        given["sensors"] = [name.strip() for name in sensors.split(",") if name.strip()]

    def write(to: Path) -> Path:
        return simulate_to(scene, to, workers=workers, progress=progress, **given)

    return in_temporary_file(write) if output is None else Recording(write(Path(output)))
