"""RNIN (Chen et al., ISMAR 2021): odometry from an IMU alone."""
