"""RadarHD's real walks: pictures of a radar and scans of a lidar; their clocks, poses and point clouds."""
