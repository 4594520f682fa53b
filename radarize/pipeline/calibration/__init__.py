"""Calibration of a radar from an ordinary walk: channels, range bias, mounting.

walk -> cells (snapshots of the antennas) -> channels (plane waves) -> egomotion (shifts of directions, tilt)
     -> tracks -> parallax (range bias)   -> mounting (height, yaw, lever arm) -> calibration (board file)
"""
