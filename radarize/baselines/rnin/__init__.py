"""RNIN (Chen et al., ISMAR 2021): an IMU alone."""
