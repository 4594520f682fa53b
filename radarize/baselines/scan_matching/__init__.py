"""Odometry from scans alone, whatever they are made with."""
