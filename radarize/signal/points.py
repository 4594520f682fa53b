"""Sparse point cloud of TI's demo firmware, computed from raw frames.

The steps of the mmWave SDK 3.x demo (`Mmwave demo data processing chain`), with its default settings:

    range transform (Blackman window, padded to a power of two) -> static clutter removal, where asked for
    -> Doppler transform (Hann window) -> mean level of all virtual antennas, in logarithms
    -> CFAR over range (smallest of both sides), and over Doppler (mean of both sides)
    -> only local maxima -> delays between transmitters compensated at the cell's speed
    -> azimuth transform of the longest row, its peak and optionally a second one
    -> elevation from the phase between that row and the nearest one above or below
"""

import numpy as np
import scipy.fft
import torch
from jaxtyping import Bool, Complex, Complex64, Float, Int, Int16
from pydantic import Field
from scipy.ndimage import maximum_filter

from radarize.io.errors import InputError
from radarize.io.plain import Frozen, setting
from radarize.radar.array import azimuth_row, row_beside, rows, virtual_positions
from radarize.radar.config import RadarConfig
from radarize.radar.windows import periodic
from radarize.signal.heatmaps import Heatmaps

#: Columns of a point cloud.
COLUMNS = ("x", "y", "z", "velocity", "snr", "noise")


class Cfar(Frozen):
    """CFAR along one axis, as one ``cfarCfg`` line: a cell is detected if it exceeds the level of its neighbours."""

    window: int = setting(8, "cells averaged on each side", "cells", ge=1)
    guard: int = setting(4, "cells left out on each side", "cells", ge=0)
    threshold: float = setting(15.0, "minimum level above the neighbours", "dB")
    smallest: bool = setting(False, "compare with the lower of the two sides (CASO) instead of their mean (CA)")


class PointCloudConfig(Frozen):
    """Settings of the chain, with the defaults of TI's profile for the xWR1843.

    Attributes:
        range_cfar: ``cfarCfg -1 0 2 8 4 3 0 15 1``.
        doppler_cfar: ``cfarCfg -1 1 0 4 2 3 1 15 1``.
        clutter_removal: subtract the mean over loops, and with it static targets (``clutterRemoval``).
        second_peak: power relative to the first peak from which a second point is added at the same range and speed
            (``multiObjBeamForming``); above 1: never.
        angles: azimuth cells.
        min_range: smallest range, beyond the transmitters' leakage, m (``cfarFovCfg``).
    """

    range_cfar: Cfar = Cfar(window=8, guard=4, smallest=True)
    doppler_cfar: Cfar = Cfar(window=4, guard=2)
    clutter_removal: bool = False
    second_peak: float = Field(0.5, gt=0)
    angles: int = Field(64, ge=8)
    min_range: float = Field(0.2, ge=0)


#: For methods that need many points, such as RANSAC over them (`doppler-ransac`): thresholds 10 dB lower.
DENSE = PointCloudConfig(
    range_cfar=Cfar(window=8, guard=4, smallest=True, threshold=5.0),
    doppler_cfar=Cfar(window=4, guard=2, threshold=5.0),
)


class PointClouds:
    """Point clouds for one radar configuration.

    Raises:
        InputError: the configuration has too few loops or samples for the CFAR windows.
    """

    def __init__(self, config: RadarConfig, settings: PointCloudConfig | None = None):
        self.config, self.settings = config, settings or PointCloudConfig()
        self._bins = 1 << (config.samples - 1).bit_length()
        self._dopplers = 1 << (config.loops - 1).bit_length()
        for name, cfar, cells in (
            ("samples", self.settings.range_cfar, self._bins),
            ("loops", self.settings.doppler_cfar, self._dopplers),
        ):
            least = 2 * (cfar.window + cfar.guard) + 1
            if cells < least:
                raise InputError(
                    f"point cloud: {name} give {cells} cells, expected at least {least} for a CFAR window of "
                    f"{cfar.window} and guard of {cfar.guard}"
                )
        spacing = config.range_resolution * config.samples / self._bins
        self.ranges = spacing * np.arange(self._bins) - config.range_bias
        step = config.velocity_resolution * config.loops / self._dopplers
        self.velocities = step * (np.arange(self._dopplers) - self._dopplers // 2)
        window = periodic(np.blackman, config.samples)
        loops = periodic(np.hanning, config.loops)
        self._range_window = (window / window.sum()).astype(np.float32)
        self._loop_window = (loops / loops.sum()).astype(np.float32)[:, None, None, None]
        delay = np.asarray(config.slot) * config.chirp_time
        turn = np.exp(4j * np.pi / config.wavelength * self.velocities[:, None] * delay)
        self._turn = np.repeat(turn, len(config.rx), axis=1)  # (doppler, antenna)

        # Direction cosines on which the firmware's transform of half-wavelength steps falls.
        self.u_y = (np.arange(self.settings.angles) - self.settings.angles // 2) * 2 / self.settings.angles
        place = virtual_positions(config).reshape(-1, 3)
        self._row = azimuth_row(config)
        by_height = {height: members for height, members in rows(config).items() if len(members) > 1}
        height = next(h for h, members in rows(config).items() if members[0] == self._row[0])
        beside = row_beside(by_height, height)
        self._other = None if beside is None else by_height[beside]
        phase = -2j * np.pi / config.wavelength
        self._steering = np.exp(-phase * place[self._row, 1][:, None] * self.u_y)
        if self._other is not None:
            self._other_steering = np.exp(-phase * place[self._other, 1][:, None] * self.u_y)
            self._rise = (place[self._other[0], 2] - place[self._row[0], 2]) / config.wavelength

    def __call__(
        self,
        adc: Int16[np.ndarray, "frame loop tx rx sample 2"],
        valid: Bool[np.ndarray, "frame loop tx"] | None = None,
    ) -> tuple[Float[np.ndarray, "point 6"], Int[np.ndarray, "point"]]:
        """Points of several frames.

        Args:
            adc: raw samples.
            valid: False where a chirp was lost; lost chirps have zero weight.

        Returns:
            x forward, y left, z up (m), radial speed (m/s, closing positive: the firmware's sign is the opposite),
            SNR and noise level (dB, the latter against one ADC count), frame by frame and by ascending range; and the
            frame that each belongs to, counted from 0.

        Raises:
            InputError: the shape does not fit the configuration.
        """
        if tuple(adc.shape[1:]) != self.config.frame_shape:
            raise InputError(f"frames have shape {tuple(adc.shape[1:])}, expected {self.config.frame_shape}")
        cube = self._cube(np.asarray(adc), valid)
        return self._points(cube, self.ranges, self.velocities, self._turn)

    def of(
        self, heatmaps: Heatmaps, spectrum: Complex64[torch.Tensor, "frame range doppler antenna"]
    ) -> tuple[Float[np.ndarray, "point 6"], Int[np.ndarray, "point"]]:
        """Detect points in an existing spectrum, with its windows and bins instead of the chip's.

        Args:
            heatmaps: maker of the spectrum.
            spectrum: see `Heatmaps.spectrum`.
        """
        cube = spectrum.permute(0, 2, 3, 1).cpu().numpy()
        return self._points(cube, heatmaps.ranges, heatmaps.velocities, np.ones((cube.shape[1], 1)))

    def _points(
        self, cube: np.ndarray, ranges: np.ndarray, velocities: np.ndarray, turn: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Points of spectra (frame, doppler, antenna, range), and their frames.

        Args:
            cube: spectra.
            ranges, velocities: axes of its cells.
            turn: (doppler, antenna) phase factors that compensate the delays between transmitters.
        """
        level, noise, found = self.detect(cube, ranges)
        frame, near, speed = np.nonzero(found)
        noise = noise[frame, near, speed]
        snr = level[frame, near, speed] - noise
        x = cube[frame, speed, :, near] * turn[speed]
        which, u_y, u_z = self._directions(x)
        u_x = np.sqrt(np.clip(1 - u_y**2 - u_z**2, 0, None))
        points = np.column_stack(
            [ranges[near][which, None] * np.column_stack([u_x, u_y, u_z]), velocities[speed][which],
             snr[which], noise[which]]
        )  # fmt: skip
        real = u_y**2 + u_z**2 < 1
        return points[real], frame[which][real]

    def _cube(self, adc: np.ndarray, valid: np.ndarray | None) -> np.ndarray:
        """Spectrum (frame, doppler, antenna, range), Doppler ascending."""
        iq = adc.astype(np.float32).view(np.complex64)[..., 0]
        if valid is not None:
            iq = iq * valid[..., None, None]
        profiles = scipy.fft.fft(iq * self._range_window, self._bins, axis=-1)
        profiles *= self.config.calibration.astype(np.complex64)[:, :, None]
        if self.settings.clutter_removal:
            profiles -= profiles.mean(axis=1, keepdims=True)
        # A closing echo's phase falls: the inverse transform's sign makes closing speeds ascend.
        spectrum = scipy.fft.ifft(profiles * self._loop_window, self._dopplers, axis=1, norm="forward")
        spectrum = np.fft.fftshift(spectrum, axes=1)
        return spectrum.reshape(*spectrum.shape[:2], -1, self._bins)

    def detect(
        self, cube: np.ndarray, ranges: np.ndarray | None = None
    ) -> tuple[
        Float[np.ndarray, "frame range doppler"],
        Float[np.ndarray, "frame range doppler"],
        Bool[np.ndarray, "frame range doppler"],
    ]:
        """Level (dB), surrounding noise (dB) and detection mask of each cell of a spectrum; default ranges: the
        chip's."""
        power = cube.real**2 + cube.imag**2
        level = 10 * np.log10(power + np.float32(1e-9)).mean(axis=2).transpose(0, 2, 1)
        over_range, over_doppler = self.settings.range_cfar, self.settings.doppler_cfar
        noise = level_around(level, over_range, axis=1, cyclic=False)
        found = level > noise + over_range.threshold
        found &= level > level_around(level, over_doppler, axis=2, cyclic=True) + over_doppler.threshold
        found &= level >= maximum_filter(level, (1, 3, 3), mode=("nearest", "nearest", "wrap"))
        found &= ((self.ranges if ranges is None else ranges) >= self.settings.min_range)[:, None]
        return level, noise, found

    def _directions(
        self, x: Complex[np.ndarray, "detection antenna"]
    ) -> tuple[Int[np.ndarray, "point"], Float[np.ndarray, "point"], Float[np.ndarray, "point"]]:
        """Direction cosines to the left and up of one or two peaks per detection, and the index of the detection."""
        # One product per detection: the rounding of a joint product would depend on the number of detections in a
        # batch.
        beams = (x[:, None, self._row] @ self._steering)[:, 0]
        power = np.abs(beams) ** 2
        peak = (power >= np.roll(power, 1, axis=1)) & (power > np.roll(power, -1, axis=1))
        order = np.argsort(np.where(peak, -power, 0.0), axis=1, kind="stable")[:, :2]
        best = np.take_along_axis(np.where(peak, power, 0.0), order, axis=1)
        if len(self._row) == 1:  # a single antenna gives no direction: straight ahead
            order, best = np.full_like(order, self.settings.angles // 2), np.tile([1.0, 0.0], (len(x), 1))
        taken = np.column_stack([np.ones(len(x), bool), best[:, 1] > self.settings.second_peak * best[:, 0]])
        which, rank = np.nonzero(taken)
        cell = order[which, rank]
        u_z = np.zeros(len(which))
        if self._other is not None:
            other = (x[:, None, self._other] @ self._other_steering)[which, 0, cell]
            u_z = -np.angle(other * beams[which, cell].conj()) / (2 * np.pi * self._rise)
        return which, self.u_y[cell], u_z


def level_around(level: np.ndarray, cfar: Cfar, axis: int, cyclic: bool) -> np.ndarray:
    """Mean level (dB) of the cells around each along an axis; at the ends of a non-cyclic one, of one side."""
    reach = cfar.window + cfar.guard
    level = np.moveaxis(level, axis, -1)
    padded = np.pad(level, [(0, 0)] * (level.ndim - 1) + [(reach, reach)], mode="wrap")
    total = np.cumsum(padded, axis=-1, dtype=np.float64)
    total = np.concatenate([np.zeros_like(total[..., :1]), total], axis=-1)
    means = (total[..., cfar.window :] - total[..., : -cfar.window]) / cfar.window
    cells = level.shape[-1]
    below, above = means[..., :cells], means[..., reach + cfar.guard + 1 :][..., :cells]
    if cyclic:
        found = np.minimum(below, above) if cfar.smallest else (below + above) / 2
    else:
        index = np.arange(cells)
        both = np.minimum(below, above) if cfar.smallest else (below + above) / 2
        found = np.where(index < reach, above, np.where(index >= cells - reach, below, both))
    return np.moveaxis(found, -1, axis).astype(np.float32)
