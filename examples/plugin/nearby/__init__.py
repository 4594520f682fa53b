"""Scans, odometry and a file format of one's own."""
