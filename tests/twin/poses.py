"""Recordings whose poses were changed."""

import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

#: Takes a recording's poses and the open file; returns other poses.
Change = Callable[[np.ndarray, h5py.File], np.ndarray]


def altered(recording: Path, path: Path, change: Change) -> Path:
    """Copy of a recording with changed poses and other changes."""
    shutil.copy(recording, path)
    with h5py.File(path, "r+") as file:
        file["truth/pose"][:] = change(file["truth/pose"][:], file)
    return path


def shaken(metres: float, degrees: float) -> Change:
    """Add slow random errors to poses; standard deviations."""

    def change(poses: np.ndarray, file: h5py.File) -> np.ndarray:
        noise = gaussian_filter1d(np.random.default_rng(1).standard_normal((len(poses), 6)), 2, axis=0)
        noise /= noise.std(axis=0)
        turn = Rotation.from_rotvec(np.deg2rad(degrees) * noise[:, 3:]) * Rotation.from_quat(poses[:, 3:])
        return np.hstack([poses[:, :3] + metres * noise[:, :3], turn.as_quat()])

    return change
