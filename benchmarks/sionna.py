"""Propagation paths by Sionna RT's `PathSolver`, compared with this simulator by `benchmarks.simulator_speed`.

Paths are traced anew for every frame between the centres of the transmit and the receive array; antennas and motion
within the burst follow from each path's directions (far field, plane waves). Sionna's coefficients leave out
exp(-j 2 pi f tau); the synthesis puts it in.

Known errors of Sionna RT 2.2.0 as a radar simulator. Do not train on these recordings:

* Corner reflections are missing: 12 of 18 second-order and 8 of 38 third-order images of a box room.
* Every facet is an infinite mirror: plates of 2 cm and of 2 m at 3 m both have a cross section of pi R^2 = 28 m^2; a
  finely tessellated sphere has no echo, and a scanned wall has specular reflections that depend on the scan's noise.
* Diffuse paths are drawn from a lattice fixed to the sensor, anew in every call, without a random phase: speckle keeps
  nothing from one position to another (correlation with the true field 0.99 after 0.1 mm, 0.40 after 1 mm, 0.06 after
  2 mm), so there is no Doppler from frame to frame and no texture to match.
* Reciprocity fails: specular-then-diffuse paths are found, diffuse-then-specular ones are not: half of all ghosts.
"""

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from jaxtyping import Complex, Float
from scipy.spatial.transform import Rotation

from radarize.radar.array import rx_positions, tx_positions
from radarize.radar.config import SPEED_OF_LIGHT, RadarConfig
from radarsim.propagation.antenna import Antenna, amplitude_gain, gain_pattern
from radarsim.propagation.burst import BurstClock, parabola
from radarsim.scenario import Scenario
from radarsim.world.scene import Scene

RAYS = 100_000
DEPTH = 3


@dataclass(frozen=True)
class Paths:
    """The paths of a frame, in place of `radarsim.propagation.paths.Paths`.

    Attributes:
        length: out and back, between the centres of the arrays in the middle of the burst, m.
        departure, arrival: unit vectors from the sensor along the first and the last path segment, world.
        tx_center, rx_center: centres of the arrays in the middle of the burst, world, m.
        amplitude: square root of received over transmitted power, with phase, as in the beat signal.
    """

    length: Float[np.ndarray, "path"]
    departure: Float[np.ndarray, "path 3"]
    arrival: Float[np.ndarray, "path 3"]
    tx_center: Float[np.ndarray, "3"]
    rx_center: Float[np.ndarray, "3"]
    amplitude: Complex[np.ndarray, "path"]

    def __len__(self) -> int:
        return len(self.amplitude)

    def lengths(self, config: RadarConfig, motion, time: float) -> Float[np.ndarray, "path virtual 3"]:
        """Return path lengths over the burst, as `Paths.lengths`: reduced by the antenna's motion along the path."""
        times = time + BurstClock.of(config).nodes
        return self.lengths_from(motion.position(times), motion.rotation(times).as_matrix(), config)

    def lengths_from(
        self, position: Float[np.ndarray, "node 3"], rotation: Float[np.ndarray, "node 3 3"], config: RadarConfig
    ) -> Float[np.ndarray, "path virtual 3"]:
        """Return path lengths from poses at the nodes of the burst, as `Paths.lengths_from`."""
        tx = position[:, None] + tx_positions(config) @ rotation.transpose(0, 2, 1) - self.tx_center
        rx = position[:, None] + rx_positions(config) @ rotation.transpose(0, 2, 1) - self.rx_center
        out = np.einsum("pd,tkd->pkt", self.departure, tx)
        back = np.einsum("pd,trd->prt", self.arrival, rx)
        values = self.length[:, None, None, None] - out[:, :, None] - back[:, None]
        return np.stack(parabola(*np.moveaxis(values.reshape(len(self), -1, len(position)), -1, 0)), axis=-1)


class PathSolverFinder:
    """Finds paths as `PathFinder` does.

    Args:
        scene: the world.
        config: radar configuration.
        weakest: paths below this amplitude are left out.
        antenna: the elements' pattern; default: the board's.
        seed: of Sionna's samples.
    """

    def __init__(
        self, scene: Scene, config: RadarConfig, weakest: float = 0.0, antenna: Antenna | None = None, seed: int = 0
    ):
        self.scene, self.config, self.weakest, self.seed = scene, config, weakest, seed
        self._pattern = gain_pattern(antenna or Antenna.of(config.board))
        world = scene.sionna  # before the import: it looks for LLVM
        import sionna.rt as rt

        world.frequency = config.center_frequency
        world.tx_array = world.rx_array = rt.PlanarArray(num_rows=1, num_cols=1, pattern="iso", polarization="V")
        for name in [*world.transmitters, *world.receivers]:
            world.remove(name)
        self._tx, self._rx = rt.Transmitter("tx", [0.0, 0.0, 0.0]), rt.Receiver("rx", [0.0, 0.0, 0.0])
        world.add(self._tx)
        world.add(self._rx)
        self._solve = rt.PathSolver(deterministic=True)

    def batch(
        self,
        positions: Float[np.ndarray, "frame 3"],
        rotations: Float[np.ndarray, "frame 3 3"],
        times: Float[np.ndarray, "frame"],
    ) -> list[Paths]:
        """Find the paths of several frames, one solver call each; the scene is static."""
        return [self(p, r) for p, r in zip(positions, rotations, strict=True)]

    def __call__(self, position: Float[np.ndarray, "3"], rotation: Float[np.ndarray, "3 3"]) -> Paths:
        """Find the paths of one sensor pose (rotation: sensor to world)."""
        tx = position + rotation @ tx_positions(self.config).mean(axis=0)
        rx = position + rotation @ rx_positions(self.config).mean(axis=0)
        turn = [float(x) for x in Rotation.from_matrix(rotation).as_euler("ZYX")]
        for device, place in ((self._tx, tx), (self._rx, rx)):
            device.position, device.orientation = [float(x) for x in place], turn
        found = self._solve(
            self.scene.sionna, max_depth=DEPTH, samples_per_src=RAYS, los=False, diffuse_reflection=True,
            refraction=False, seed=self.seed,
        )  # fmt: skip
        real, imaginary = (part.numpy().ravel() for part in found.a)
        delay = found.tau.numpy().ravel()
        departure = _unit(found.theta_t.numpy().ravel(), found.phi_t.numpy().ravel())
        arrival = _unit(found.theta_r.numpy().ravel(), found.phi_r.numpy().ravel())
        gain = [np.array([amplitude_gain(*d, self._pattern) for d in u @ rotation]) for u in (departure, arrival)]
        # Sionna's carrier has the phase e^{+jwt}, a beat signal the opposite sign: conjugate.
        amplitude = (real - 1j * imaginary).astype(complex)
        amplitude *= gain[0] * gain[1] if len(amplitude) else 1
        keep = (np.abs(amplitude) > self.weakest) & (delay > 0)
        keep &= SPEED_OF_LIGHT * delay < 2 * 1.05 * self.config.max_range
        return Paths(
            SPEED_OF_LIGHT * delay[keep].astype(float), departure[keep], arrival[keep], tx, rx, amplitude[keep]
        )


class SionnaScenario(Scenario):
    """A scenario whose echoes are the paths of Sionna RT."""

    @classmethod
    def of(cls, scenario: Scenario) -> "SionnaScenario":
        """Return the same scenario with Sionna RT's paths."""
        return cls(*(getattr(scenario, field.name) for field in fields(Scenario)))

    @cached_property
    def finder(self) -> PathSolverFinder:
        """Path finder of the scenario."""
        seed = int(self.rng("sionna").integers(2**31))
        return PathSolverFinder(self.scene, self.config, self.board.weakest, self.board.settings.pattern, seed)


def _unit(zenith: Float[np.ndarray, "n"], azimuth: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n 3"]:
    return np.stack(
        [np.sin(zenith) * np.cos(azimuth), np.sin(zenith) * np.sin(azimuth), np.cos(zenith)], axis=1
    ).astype(float)
