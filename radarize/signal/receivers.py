"""Interpolation of broken receivers from their neighbours in the array.

A cell of range and Doppler seldom has more than one strong echo, whose phase is linear over the receivers. So
a dead or saturated receiver, which would cause sidelobes in every direction, is interpolated: its value is the mean of
the neighbours on either side, each rotated by the phase step of the others. No information is added.
"""

import numpy as np
import torch
from jaxtyping import Bool, Complex64

from radarize.radar.array import rx_positions
from radarize.radar.config import RadarConfig


class Receivers:
    """Interpolation for one radar's array."""

    def __init__(self, config: RadarConfig):
        grid = np.rint(rx_positions(config)[:, 1:] / (config.wavelength / 2)).astype(int)
        self._left, self._height = grid.T

    def filled(
        self,
        spectrum: Complex64[torch.Tensor, "frame range doppler antenna"],
        broken: Bool[np.ndarray, "frame rx"],
    ) -> Complex64[torch.Tensor, "frame range doppler antenna"]:
        """Interpolate the broken receivers of a spectrum; those with too few neighbours in their row become zero."""
        if not broken.any():
            return spectrum
        spectrum = spectrum.clone()
        for frame in np.flatnonzero(broken.any(axis=1)):
            cells = spectrum[frame].unflatten(-1, (-1, broken.shape[1]))
            self._fill(cells, np.flatnonzero(broken[frame]), np.flatnonzero(~broken[frame]))
        return spectrum

    def _fill(
        self, cells: Complex64[torch.Tensor, "range doppler tx rx"], broken: np.ndarray, whole: np.ndarray
    ) -> None:
        """Interpolate broken receivers in place."""
        step = sum(
            (cells[..., b] * cells[..., a].conj()).sum(dim=-1, keepdim=True)
            for a in whole
            for b in whole
            if self._height[a] == self._height[b] and self._left[b] - self._left[a] == 1
        )
        for place in broken:
            row = whole[self._height[whole] == self._height[place]]
            away = self._left[row] - self._left[place]
            nearest = [row[side][np.abs(away[side]).argmin()] for side in (away < 0, away > 0) if side.any()]
            cells[..., place] = 0
            if isinstance(step, torch.Tensor):
                turn = step / step.abs().clamp_min(1e-30)
                for other in nearest:
                    count = int(self._left[place] - self._left[other])
                    carried = cells[..., other] * (turn if count > 0 else turn.conj()) ** abs(count)
                    cells[..., place] += carried / len(nearest)
