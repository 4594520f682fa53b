"""Sensors of a recording beside the radar, and ground truth."""
