"""Planar SLAM from range scans and odometry. `backend.Slam` is the algorithm, `config.SlamConfig` its parameters."""
