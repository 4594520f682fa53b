"""RadarHD (Prabhakara et al., ICRA 2023): a network that estimates a lidar's pictures from a radar's."""
