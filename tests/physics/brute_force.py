"""Independent float64 reference: the beat signal of world points sample by sample, from the motion itself."""

import numpy as np

from radarize.radar.array import rx_positions, tx_positions
from radarize.radar.config import SPEED_OF_LIGHT, RadarConfig


def beat(config: RadarConfig, motion, time: float, points, amplitude) -> np.ndarray:
    """Sum over echoes with path length |tx - a| + |b - rx|, every antenna placed anew at every sample instant.

    The instantaneous phase of a dechirped echo of delay tau at time t on a ramp f(t) is 2 pi f(t) tau.
    """
    loops, n_tx, n_rx, samples, _ = config.frame_shape
    on_ramp = (np.arange(samples) - (samples - 1) / 2) / config.sample_rate
    frequency = config.center_frequency + config.slope * on_ramp
    out = np.zeros((loops, n_tx, n_rx, samples), complex)
    for loop in range(loops):
        for k in range(n_tx):
            at = time + config.chirp_times[loop, k] + on_ramp
            position, rotation = motion.position(at), motion.rotation(at).as_matrix()
            tx = position + np.einsum("nij,j->ni", rotation, tx_positions(config)[k])
            there = np.linalg.norm(points[:, None, 0] - tx, axis=2)
            for r in range(n_rx):
                rx = position + np.einsum("nij,j->ni", rotation, rx_positions(config)[r])
                back = np.linalg.norm(points[:, None, 1] - rx, axis=2)
                phase = frequency * (there + back) / SPEED_OF_LIGHT
                out[loop, k, r] = (amplitude[:, None] * np.exp(2j * np.pi * phase)).sum(axis=0)
    return out
