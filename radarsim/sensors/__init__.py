"""Sensors of a recording beside the radar, and truths that no sensor measures."""
