"""Heat maps of frames as `xarray` arrays with named axes."""

from collections.abc import Callable
from typing import Literal

import numpy as np
import torch
import xarray
from jaxtyping import Float

from radarize.io.errors import InputError
from radarize.io.load import Samples, Source, samples_of
from radarize.signal.effort import together
from radarize.signal.heatmaps import AZIMUTHS, Heatmaps

Beamformer = Literal["bartlett", "capon", "elevation-aware"]
_UNITS = {"range": "m", "doppler": "m/s", "azimuth": "rad"}


def range_azimuth(
    frames: Samples | Source, *, method: Beamformer = "bartlett", azimuths: Float[np.ndarray, "azimuth"] | None = None
) -> xarray.DataArray:
    """Compute range-azimuth maps: power over range and azimuth, summed over Doppler.

    Args:
        frames: frames of a recording, such as ``rec[100:110]`` or ``rec[100]``; a recording for all of its frames.
        method: beamformer, ``"bartlett"`` (Taylor-windowed sum over the longest row of antennas), ``"capon"`` (minimum
            variance, sharper), or ``"elevation-aware"`` (pairs of antennas that attenuate ceiling and floor).
        azimuths: rad, positive to the left; -60 to 60 deg in steps of 1 deg if None.

    Returns:
        (frame, range, azimuth), without the axis of frames for a single frame; squared ADC counts: an echo of
        amplitude A has the value A^2. Coordinates: ``range`` m, ``azimuth`` rad, ascending, positive to the left,
        ``time`` s.

    Raises:
        InputError: a recording without samples, or an array without the antennas that the method needs.

    Example:
        >>> maps = rz.range_azimuth(rec[4:8])
        >>> dict(maps.sizes)
        {'frame': 4, 'range': 96, 'azimuth': 121}
        >>> ahead = maps.sel(azimuth=0, method="nearest")
        >>> float(ahead.range[1])  # range resolution, m
        0.04...
    """
    _check("method", method, ("bartlett", "capon", "elevation-aware"))

    def power(maps: Heatmaps, spectrum: torch.Tensor) -> torch.Tensor:
        if method == "elevation-aware":
            return maps.elevation_aware_of(spectrum)
        return maps.range_azimuth_of(spectrum, method)

    return _made(samples_of(frames), power, "range", "azimuth", azimuths=azimuths)


def doppler_azimuth(
    frames: Samples | Source,
    *,
    method: Beamformer = "bartlett",
    azimuths: Float[np.ndarray, "azimuth"] | None = None,
    limited: bool = False,
) -> xarray.DataArray:
    """Compute Doppler-azimuth maps: power over closing speed and azimuth, summed over range.

    A static world seen by a radar that moves with speed v in direction theta lies at v cos(azimuth - theta).

    Args:
        frames, method, azimuths: see `range_azimuth`.
        limited: limit the amplitude of each cell of the spectrum first, so that specular reflections do not hide the
            rest. With ``method="capon"`` and the azimuths of `radarize.signal.maps.AZIMUTHS` this is the map of that
            name that is the input of networks and of `rz.torch_dataset`, there in dB.

    Returns:
        (frame, doppler, azimuth), without the axis of frames for a single frame; squared ADC counts. Coordinates:
        ``doppler`` m/s, ascending, closing positive, ``azimuth`` rad, ``time`` s.

    Raises:
        InputError: see `range_azimuth`.

    Example:
        >>> rz.doppler_azimuth(rec[4]).dims
        ('doppler', 'azimuth')
    """
    _check("method", method, ("bartlett", "capon", "elevation-aware"))

    def power(maps: Heatmaps, spectrum: torch.Tensor) -> torch.Tensor:
        cells = maps.limited(spectrum) if limited else spectrum
        return maps.doppler_azimuth_of(cells, method, elevation_aware=method == "elevation-aware")

    return _made(samples_of(frames), power, "doppler", "azimuth", azimuths=azimuths)


def range_doppler(frames: Samples | Source) -> xarray.DataArray:
    """Compute range-Doppler maps: power over range and closing speed, averaged over all virtual antennas.

    Args:
        frames: see `range_azimuth`.

    Returns:
        (frame, range, doppler), without the axis of frames for a single frame; squared ADC counts. Coordinates:
        ``range`` m, ``doppler`` m/s, ascending, closing positive, ``time`` s.

    Raises:
        InputError: a recording without samples.

    Example:
        >>> power = rz.range_doppler(rec[4])
        >>> power.dims, power.doppler.units
        (('range', 'doppler'), 'm/s')
    """
    return _made(samples_of(frames), Heatmaps.range_doppler_of, "range", "doppler")


def range_profile(frames: Samples | Source) -> xarray.DataArray:
    """Compute range profiles: power over range, summed over Doppler and averaged over all virtual antennas.

    Args:
        frames: see `range_azimuth`.

    Returns:
        (frame, range), without the axis of frames for a single frame; squared ADC counts. Coordinates: ``range`` m,
        ``time`` s.

    Raises:
        InputError: a recording without samples.

    Example:
        >>> profile = rz.range_profile(rec[4])
        >>> nearest = profile.where(profile.range > 0.3).idxmax("range")
        >>> bool(0.3 < nearest < 4)
        True
    """
    return _made(samples_of(frames), Heatmaps.range_profile_of, "range")


def _made(
    frames: Samples,
    power: Callable[[Heatmaps, torch.Tensor], torch.Tensor],
    *names: str,
    azimuths: Float[np.ndarray, "azimuth"] | None = None,
) -> xarray.DataArray:
    maps = Heatmaps(frames.config, AZIMUTHS if azimuths is None else azimuths)
    size = together(frames.config)
    parts = (frames[start : start + size] for start in range(0, len(frames), size))
    made = [power(maps, maps.spectrum(part.samples, part.valid)).numpy() for part in parts]
    axes = {"range": maps.ranges, "doppler": maps.velocities, "azimuth": maps.azimuths}
    empty = np.zeros((0, *(len(axes[name]) for name in names)), np.float32)
    found = xarray.DataArray(
        np.concatenate([empty, *made]),
        dims=("frame", *names),
        coords={
            "frame": np.array(frames.numbers),
            "time": ("frame", frames.times, {"units": "s"}),
            **{name: (name, axes[name], {"units": _UNITS[name]}) for name in names},
        },
        name="power",
        attrs={"units": "counts^2"},
    )
    return found[0] if frames.alone else found


def _check(name: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise InputError(f"{name} is {value!r}, expected one of {', '.join(known)}")
