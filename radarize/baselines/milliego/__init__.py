"""milliEgo (Lu et al., SenSys 2020): a sparse point cloud and an IMU."""
