"""What odometry by a network has in common that reads an IMU."""

from radarize.learning.nets.weights import Network, load
from radarize.odometry.displacements import DisplacementIntegrator
from radarize.odometry.inertial import Imu
from radarize.pipeline.method import Inputs


class InertialOdometry:
    """A trained network, the IMU that it reads, and the path that displacements make.

    Args:
        inputs: with the recording that holds the IMU, and the weights.

    Attributes:
        network, lasts: set by the subclass; the latter is over how many seconds displacements are told.

    Raises:
        InputError: no recording, no IMU, or no such weights.
    """

    network: type[Network]
    lasts: float

    def __init__(self, inputs: Inputs):
        kind = self.network.kind
        self.imu = Imu.of(inputs.imu(kind))
        self.net, self.header = load(inputs.weights.of(kind), self.network)
        self.path = DisplacementIntegrator(self.lasts, inputs.radar.frame_period)
