"""Odometry by scan matching, on the scans of any method."""
