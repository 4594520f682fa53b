"""Doppler RANSAC on sparse points (Doer and Trommer, REVE, 2020), with the yaw rates of the method `doppler`."""
