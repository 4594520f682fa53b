"""Base class of odometry by networks that read an IMU."""

from radarize.learning.nets.weights import Network, load
from radarize.odometry.displacements import DisplacementIntegrator
from radarize.odometry.inertial import Imu
from radarize.pipeline.method import Inputs


class InertialOdometry:
    """Odometry by a trained network that estimates displacements from an IMU, which are integrated to a path.

    Args:
        inputs: recording with the IMU, and weights.

    Attributes:
        network: class of the network; set by the subclass.
        lasts: time span of a displacement, s; set by the subclass.

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
