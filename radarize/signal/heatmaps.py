"""Heat maps of raw frames: range, Doppler and azimuth spectra, batched over frames in torch.

Every map starts from one spectrum per frame (`Heatmaps.spectrum`): calibrated, windowed, transformed over samples and
loops, and compensated for the delay between TDM slots per Doppler bin. After that all virtual antennas appear
simultaneously sampled, and beamforming is a product with steering vectors of their true positions.

Scaling, with amplitudes in ADC counts: a point echo of amplitude A has the peak A^2 in every map. Axes that a map
does not have (Doppler in range-azimuth, range in Doppler-azimuth) are summed, so that echoes add in power.
"""

from functools import cache, cached_property
from typing import Literal

import numpy as np
import torch
from jaxtyping import Bool, Complex64, Float32, Int, Real

from radarize.io.errors import InputError
from radarize.io.plain import Frozen, setting
from radarize.radar.array import azimuth_row, elevation_pairs, virtual_positions
from radarize.radar.config import RadarConfig
from radarize.radar.windows import taylor

#: Default azimuth grid: -60...60 deg, ascending (left is positive); the antenna's gain is 15 dB down at its ends.
AZIMUTHS = np.radians(np.arange(-60.0, 61.0))


class HeatmapConfig(Frozen):
    """Spectra and beamformers of the classical methods."""

    loading: float = setting(
        0.01, "diagonal loading of Capon's covariance, as a fraction of its mean eigenvalue", "1", gt=0
    )


class Heatmaps:
    """Heat maps for one radar configuration; stores windows and steering matrices.

    Windows trade resolution for sidelobes: Hann over samples, whose sidelobes fall by 18 dB per octave, because the
    transmitter's leakage in the lowest bins must not appear as a static target at every range; Hamming
    (-43 dB) over loops, because a wall's specular reflection is 40 dB above furniture; Taylor (-25 dB) over the few
    antennas, which widens the 12.8 deg beam of 8 elements to 15 deg.

    Args:
        azimuths: (azimuth,) columns of all maps, rad, ascending.
        settings: settings of the beamformers.

    Attributes:
        ranges: (range,) m, `config.range_bias` subtracted.
        velocities: (doppler,) m/s, ascending, zero in the middle, closing positive.
        azimuths: (azimuth,) rad.
    """

    def __init__(self, config: RadarConfig, azimuths: np.ndarray = AZIMUTHS, settings: HeatmapConfig | None = None):
        self.config, self.settings = config, settings or HeatmapConfig()
        self.azimuths = np.asarray(azimuths, float)
        self.ranges = config.ranges - config.range_bias
        bins = np.arange(config.loops) - config.loops // 2
        self.velocities = bins * config.velocity_resolution

        self._range_window = self._tensor(np.hanning(config.samples), torch.float32)
        self._range_window /= self._range_window.sum()
        self._loop_window = self._tensor(np.hamming(config.loops), torch.float32)
        # A closing target's phase falls: frequency -2 v / wavelength. A slot's delay is compensated at that rate.
        delay = np.asarray(config.slot) * config.chirp_time
        turn = np.exp(4j * np.pi / config.wavelength * self.velocities[:, None] * delay)
        self._slots = self._tensor(turn[:, :, None], torch.complex64)  # (doppler, tx, 1)
        self._calibration = self._tensor(config.calibration, torch.complex64)

        self.row = azimuth_row(config)
        self.pairs = elevation_pairs(config)
        self._steering = self._beams(self.row)
        self._pair_steering = None if self.pairs is None else self._beams(self.pairs[:, 0])

    def _tensor(self, values: np.ndarray, kind: torch.dtype) -> torch.Tensor:
        return torch.as_tensor(np.asarray(values)).to(kind)

    def steering(self, antennas: np.ndarray, u_y: np.ndarray) -> np.ndarray:
        """Far-field phasors (antenna, direction) of flat virtual antennas for direction cosines u_y to the left."""
        y = virtual_positions(self.config).reshape(-1, 3)[antennas, 1]
        return np.exp(-2j * np.pi / self.config.wavelength * y[:, None] * np.asarray(u_y))

    def _beams(self, antennas: np.ndarray) -> torch.Tensor:
        return self._tensor(self.steering(antennas, np.sin(self.azimuths)), torch.complex64)

    @staticmethod
    @cache
    def _taper(count: int) -> Float32[torch.Tensor, "antenna 1"]:
        taper = taylor(count)
        return torch.as_tensor(taper / taper.sum()).float()[:, None]

    def spectrum(
        self,
        adc: Real[np.ndarray, "frame loop tx rx sample 2"],
        valid: Bool[np.ndarray, "frame loop tx"] | None = None,
    ) -> Complex64[torch.Tensor, "frame range doppler antenna"]:
        """Range-Doppler spectrum of every virtual antenna, flat (tx, rx), with TDM delays compensated.

        The compensation uses each bin's speed; echoes beyond `config.max_velocity` alias and keep a phase step of 2 pi
        slot / slots between transmitters, see `unfolded`. Lost chirps have zero weight and the remaining ones of the
        same transmitter a larger one, so that transmitters stay balanced; a transmitter without any chirp gives zero.

        Args:
            adc: raw samples, also as a torch tensor.
            valid: False where a chirp was lost; all true if None.

        Raises:
            InputError: the shape does not fit the configuration.
        """
        if tuple(adc.shape[1:]) != self.config.frame_shape:
            raise InputError(
                f"frames have shape {tuple(adc.shape[1:])}, expected {self.config.frame_shape} "
                "(loop, tx, rx, sample, iq) from the configuration"
            )
        samples = torch.view_as_complex(torch.as_tensor(adc).float())
        weights = self._loop_weights(len(samples), valid)  # (frame, loop, tx)
        profiles = torch.fft.fft(samples * self._range_window, dim=-1)
        profiles = profiles * (weights[..., None] * self._calibration)[..., None]
        # Positive Doppler frequencies recede: the inverse transform's sign makes closing speeds ascend.
        spectrum = torch.fft.fftshift(torch.fft.ifft(profiles, dim=1, norm="forward"), dim=1)
        spectrum = spectrum * self._slots[..., None]
        return spectrum.permute(0, 4, 1, 2, 3).flatten(3)

    def unfolded(
        self,
        spectrum: Complex64[torch.Tensor, "frame range doppler antenna"],
        aliases: Int[np.ndarray, "frame doppler"],
    ) -> Complex64[torch.Tensor, "frame range doppler antenna"]:
        """Shift the speeds of a spectrum's bins up by unambiguous spans, with the TDM delays compensated for them."""
        if not aliases.any():
            return spectrum
        turn = 2 * np.pi * aliases[..., None] * np.repeat(self.config.slot, len(self.config.rx))
        turn = turn / self.config.chirps_per_loop
        return spectrum * self._tensor(np.exp(1j * turn), torch.complex64)[:, None]

    def _loop_weights(self, frames: int, valid: np.ndarray | None) -> torch.Tensor:
        loops, tx = self.config.frame_shape[:2]
        weights = self._loop_window[None, :, None].expand(frames, loops, tx)
        if valid is not None:
            weights = weights * torch.as_tensor(valid)
        return weights / weights.sum(dim=1, keepdim=True).clamp_min(1e-6)

    @cached_property
    def _loop_energy(self) -> float:
        """Sum over the Doppler bins of a unit echo: loops * sum(w^2) / sum(w)^2."""
        window = self._loop_window
        return float(self.config.loops * (window**2).sum() / window.sum() ** 2)

    @cached_property
    def _range_energy(self) -> float:
        """Sum over the range bins of a unit echo."""
        return float(self.config.samples * (self._range_window**2).sum())

    @staticmethod
    def limited(spectrum: torch.Tensor, limit: float = 300.0) -> torch.Tensor:
        """Limit a spectrum's range-Doppler cells to `limit` times the noise floor, preserving phases.

        A wall's specular reflection is 40 dB above its own texture: without a limit, its sidelobes dominate all sums.
        """
        power = spectrum.real.square().sum(dim=-1) + spectrum.imag.square().sum(dim=-1)
        floor = power.flatten(1).median(dim=1).values.clamp_min(1e-9)[:, None, None]
        return spectrum * torch.rsqrt(1 + power / (limit * floor))[..., None]

    def covariance(
        self, spectrum: Complex64[torch.Tensor, "frame range doppler antenna"], antennas: np.ndarray
    ) -> Complex64[torch.Tensor, "frame range chosen chosen"]:
        """Spatial covariance per range bin, summed over Doppler: an echo of amplitude A has the diagonal A^2."""
        x = spectrum[..., torch.as_tensor(antennas)]
        return x.transpose(-1, -2) @ x.conj() / self._loop_energy

    def range_azimuth(
        self,
        adc: Real[np.ndarray, "frame loop tx rx sample 2"],
        valid: Bool[np.ndarray, "frame loop tx"] | None = None,
        method: Literal["bartlett", "capon"] = "bartlett",
    ) -> Float32[torch.Tensor, "frame range azimuth"]:
        """Power over range and azimuth of the longest horizontal row of antennas.

        Args:
            adc, valid: see `spectrum`.
            method: ``"bartlett"`` (windowed sum) or ``"capon"`` (minimum variance, Capon 1969), sharper, but with
                powers below A^2 where echoes are dense.
        """
        return self.range_azimuth_of(self.spectrum(adc, valid), method)

    def range_azimuth_of(self, spectrum: torch.Tensor, method: str = "bartlett") -> torch.Tensor:
        """`range_azimuth` from an existing spectrum."""
        covariance = self.covariance(spectrum, self.row)
        return self._capon(covariance) if method == "capon" else self._bartlett(covariance, self._steering)

    def elevation_aware(
        self,
        adc: Real[np.ndarray, "frame loop tx rx sample 2"],
        valid: Bool[np.ndarray, "frame loop tx"] | None = None,
    ) -> Float32[torch.Tensor, "frame range azimuth"]:
        """Power over range and azimuth of antenna pairs half a wavelength apart in height, averaged.

        The mean of a pair passes the horizon and nulls the zenith (paper, section 4), so echoes of ceiling and floor
        fade: by 20 log10 cos(pi/2 sin elevation).

        Raises:
            InputError: the array has no such pairs.
        """
        return self.elevation_aware_of(self.spectrum(adc, valid))

    def elevation_aware_of(self, spectrum: torch.Tensor) -> torch.Tensor:
        """`elevation_aware` from an existing spectrum."""
        x, steering = self._paired(spectrum)
        return self._bartlett(self.covariance(x, np.arange(len(steering))), steering)

    def _paired(self, spectrum: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Spectra of the elevation pairs, each the mean of lower and upper, and their steering phasors."""
        if self.pairs is None or self._pair_steering is None:
            raise InputError(
                f"tx {self.config.tx} and rx {self.config.rx} of {self.config.board} hold no antenna pairs of "
                "different height, expected transmitters or receivers in two rows for elevation"
            )
        return spectrum[..., torch.as_tensor(self.pairs)].mean(dim=-1), self._pair_steering

    def _bartlett(self, covariance: torch.Tensor, steering: torch.Tensor) -> torch.Tensor:
        beams = steering * self._taper(len(steering))
        return ((covariance @ beams) * beams.conj()).sum(dim=-2).real.clamp_min(0)

    def _capon(self, covariance: torch.Tensor) -> torch.Tensor:
        antennas = covariance.shape[-1]
        level = covariance.diagonal(dim1=-2, dim2=-1).real.mean(dim=-1)
        # The floor keeps the matrices of all-zero cells (lost frames) regular.
        load = self.settings.loading * level + 1e-12 * level.amax(dim=-1, keepdim=True) + 1e-30
        loaded = covariance + load[..., None, None] * torch.eye(antennas)
        scale = (level + load)[..., None]
        inverse = torch.linalg.inv(loaded / scale[..., None])
        power = ((inverse @ self._steering) * self._steering.conj()).sum(dim=-2).real
        # For one echo 1 / (a^H R^-1 a) = A^2 + load / antennas.
        return (scale / power.clamp_min(1e-12) - load[..., None] / antennas).clamp_min(0)

    def beamformed(
        self, spectrum: torch.Tensor, antennas: np.ndarray, steering: torch.Tensor
    ) -> Float32[torch.Tensor, "frame range doppler direction"]:
        """Windowed-sum power of chosen antennas (flat indices) for any `steering` phasors (antenna, direction)."""
        x = spectrum[..., torch.as_tensor(antennas)]
        beams = steering.conj() * self._taper(len(antennas))
        y = x @ beams
        return y.real.square() + y.imag.square()

    def doppler_azimuth(
        self,
        adc: Real[np.ndarray, "frame loop tx rx sample 2"],
        valid: Bool[np.ndarray, "frame loop tx"] | None = None,
    ) -> Float32[torch.Tensor, "frame doppler azimuth"]:
        """Power over speed and azimuth, summed over range: a static world appears at v cos(phi - theta)."""
        return self.doppler_azimuth_of(self.spectrum(adc, valid))

    def doppler_azimuth_of(
        self, spectrum: torch.Tensor, method: str = "bartlett", elevation_aware: bool = False
    ) -> torch.Tensor:
        """`doppler_azimuth` from an existing spectrum.

        Args:
            spectrum: see `spectrum`.
            method: see `range_azimuth`.
            elevation_aware: from the elevation pairs instead of the row, and by Bartlett whatever the method: there are
                too few of them for Capon.

        Raises:
            InputError: `elevation_aware` without elevation pairs.
        """
        if elevation_aware:
            x, steering = self._paired(spectrum)
        else:
            x, steering = spectrum[..., torch.as_tensor(self.row)], self._steering
        x = x.transpose(1, 2)  # (frame, doppler, range, antenna)
        covariance = x.transpose(-1, -2) @ x.conj() / self._range_energy
        sharp = method == "capon" and not elevation_aware
        return self._capon(covariance) if sharp else self._bartlett(covariance, steering)

    def range_doppler_of(self, spectrum: torch.Tensor) -> Float32[torch.Tensor, "frame range doppler"]:
        """Power over range and speed from an existing spectrum, averaged over all antennas."""
        return spectrum.abs().square().mean(dim=-1)

    def range_profile(
        self,
        adc: Real[np.ndarray, "frame loop tx rx sample 2"],
        valid: Bool[np.ndarray, "frame loop tx"] | None = None,
    ) -> Float32[torch.Tensor, "frame range"]:
        """Power over range, summed over Doppler and averaged over all antennas."""
        return self.range_profile_of(self.spectrum(adc, valid))

    def range_profile_of(self, spectrum: torch.Tensor) -> torch.Tensor:
        """`range_profile` from an existing spectrum."""
        return spectrum.abs().square().sum(dim=2).mean(dim=-1) / self._loop_energy
