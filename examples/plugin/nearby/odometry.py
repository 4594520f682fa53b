"""Odometry without turns, from Doppler-azimuth maps: ``radarize run --odometry straight``."""

import numpy as np

from radarize.odometry.integration import Track
from radarize.pipeline.method import Inputs, Method
from radarize.signal.batch import Batch


class StraightOdometry:
    """Velocity by least squares on the strongest Doppler bin of each azimuth; the yaw rate is taken as zero."""

    def __init__(self, inputs: Inputs):
        self.heatmaps = inputs.signal.heatmaps
        azimuth = self.heatmaps.azimuths
        self.solve = np.linalg.pinv(np.column_stack([np.cos(azimuth), np.sin(azimuth)]))
        self.track: Track | None = None

    def update(self, batch: Batch) -> Track:
        power = self.heatmaps.doppler_azimuth_of(batch.spectrum, "capon").numpy()  # (frame, doppler, azimuth)
        closing = self.heatmaps.velocities[power.argmax(axis=1)]  # (frame, azimuth), m/s
        velocity = closing @ self.solve.T  # (frame, 2): forward, left, m/s
        rates = np.column_stack([velocity, np.zeros(len(batch))])  # and yaw rate, rad/s
        covariance = np.tile(np.diag([0.1, 0.1, 0.5]) ** 2, (len(batch), 1, 1))  # of the rates
        self.track = Track.from_rates(batch.centers, rates, covariance, self.track)
        return self.track


METHOD = Method("straight motion", StraightOdometry)
