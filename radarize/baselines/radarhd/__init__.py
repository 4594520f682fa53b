"""RadarHD (Prabhakara et al., ICRA 2023): pictures like a lidar's."""
