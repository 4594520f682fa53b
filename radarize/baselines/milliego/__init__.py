"""milliEgo (Lu et al., SenSys 2020): odometry from a sparse point cloud and an IMU."""
