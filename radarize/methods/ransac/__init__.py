"""Doppler RANSAC over sparse points (Doer and Trommer, REVE, 2020), with the turns of `doppler`."""

from radarize.methods.method import Method

ODOMETRY = {"doppler-ransac": Method("Doppler RANSAC", "radarize.methods.ransac.velocity:odometry")}
