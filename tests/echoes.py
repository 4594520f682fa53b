"""Echoes of world points summed by brute force: an independent, slow reference for signal processing tests."""

from collections.abc import Callable

import numpy as np

from radarize.radar.array import rx_positions, tx_positions
from radarize.radar.boards import load_board
from radarize.radar.config import SPEED_OF_LIGHT, RadarConfig


def record(
    config: RadarConfig,
    pose: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    points: np.ndarray,
    amplitudes: np.ndarray,
    stamps: np.ndarray,
    rng: np.random.Generator,
    noise: float = 0.0,
    block: int = 1,
    gain: Callable[[np.ndarray], np.ndarray] | None = None,
) -> np.ndarray:
    """int16 frames (frame, loop, tx, rx, sample, 2) of static points (n, 3) with complex amplitudes in ADC counts.

    `pose` maps times to positions (..., 3) and yaws (...). Phases are exact for every chirp and antenna; the beat
    frequency is held for `block` loops (1: exact as well). Antennas have the board's signs. `gain` maps points in the
    sensor frame at the burst's middle (n, 3) to factors on their amplitudes.
    """
    n = np.arange(config.samples)
    beat = 2 * np.pi * config.slope / SPEED_OF_LIGHT * (n - (config.samples - 1) / 2) / config.sample_rate
    wavenumber = 2 * np.pi / config.wavelength
    frames = np.zeros((len(stamps), *config.frame_shape), np.int16)
    for frame, stamp in zip(frames, stamps, strict=True):
        position, yaw = pose(stamp + config.chirp_times)  # (loop, tx, 3), (loop, tx)
        here, heading = position[config.loops // 2, 0], yaw[config.loops // 2, 0]
        offset = points - here
        distance = np.linalg.norm(offset, axis=1)
        boresight = (offset[:, 0] * np.cos(heading) + offset[:, 1] * np.sin(heading)) / distance
        seen = (distance < config.max_range) & (boresight > 0.05)
        target, strength = points[seen], amplitudes[seen]
        if gain is not None:
            c, s = np.cos(heading), np.sin(heading)
            x, y, z = offset[seen].T
            strength = strength * gain(np.stack([c * x + s * y, c * y - s * x, z], axis=1))

        def length(antenna, yaw=yaw, position=position, target=target):
            """Distance of antennas at (..., 3) in the sensor frame to every point."""
            c, s = np.cos(yaw), np.sin(yaw)
            x, y, z = np.moveaxis(antenna, -1, 0)
            world = position + np.stack([c * x - s * y, s * x + c * y, z + 0 * c], axis=-1)
            return np.linalg.norm(world[..., None, :] - target, axis=-1)

        out = length(tx_positions(config)[None])  # (loop, tx, point)
        back = np.stack([length(r[None, None]) for r in rx_positions(config)], axis=2)  # (loop, tx, rx, point)
        path = out[:, :, None] + back
        phase = ((wavenumber * path) % (2 * np.pi)).astype(np.float32)
        phasor = strength.astype(np.complex64) * np.exp(np.complex64(1j) * phase)
        phasor *= np.float32(load_board(config.board).signs[config.channels])[..., None]
        signal = np.empty((*path.shape[:3], config.samples), np.complex64)
        for start in range(0, config.loops, block):
            part = slice(start, start + block)
            ramp = np.exp(1j * beat * path[part].mean(axis=(0, 1, 2))[:, None]).astype(np.complex64)
            signal[part] = phasor[part] @ ramp
        signal = np.stack([signal.real, signal.imag], axis=-1)
        signal += rng.normal(0, noise, signal.shape) if noise else 0.0
        frame[:] = np.clip(np.rint(signal), -32768, 32767)
    return frames
