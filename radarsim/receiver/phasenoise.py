"""Phase-noise sidebands after dechirping: they surround strong echoes and grow with their distance.

Receiver and transmitter share one oscillator of phase phi(t), so an echo of delay tau retains phi(t) - phi(t - tau).
With Fourier coefficients Theta of phi over the ADC window, the echo that fills bin k with S_k adds to bin m

    j S_k Theta_(m-k) (1 - exp(-j 2 pi f tau_k)),  f = (m - k) f_s / N,  tau_k = k / B,

whose power is 4 L(f) sin^2(pi f tau): nothing for near echoes (range correlation; Budge and Burt, "Range correlation
effects in radars", 1993). All channels of a chirp have the same Theta; chirps are independent, because slower phase
fluctuations cancel over delays of tens of nanoseconds.
"""

import numpy as np
from jaxtyping import Complex, Float
from numba import njit, prange

from radarize.radar.config import RadarConfig
from radarsim.receiver.frontend_config import PhaseNoise

#: Cells whose sidebands peak at this ratio (power) to the thermal noise or lower are left out.
NEGLIGIBLE = 0.01


class Sidebands:
    """Phase-noise sidebands of all range cells.

    Args:
        config: radar configuration.
        mask: phase noise.
        response: amplitude response of the IF chain at each bin; it filters the sidebands as well.
    """

    def __init__(self, config: RadarConfig, mask: PhaseNoise, response: Float[np.ndarray, "sample"]):
        n = config.samples
        step = config.sample_rate / n
        offset = step * np.arange(-(n - 1), n)
        self._level = np.sqrt(density(mask, config.center_frequency, np.abs(offset)) * step)
        self._level[n - 1] = 0  # a constant phase has no sidebands
        cell = np.arange(n)
        apart = step * (cell[None, :] - cell[:, None])  # from cell k (row) to bin m
        # An echo in cell k has passed the filter at k, its sidebands pass it at m.
        shape = np.minimum(1, response[None, :] / np.maximum(response[:, None], 1e-6))
        self._difference = (1 - np.exp(-2j * np.pi * apart * (cell / config.bandwidth)[:, None])) * shape
        spread = np.stack([self._level[n - 1 - k : 2 * n - 1 - k] for k in range(n)])
        self._peak = np.max(np.abs(spread * self._difference) ** 2, axis=1)
        self._samples = n
        self._offset = offset
        self._response = response
        self._difference = self._difference.astype(np.complex64)

    def __call__(
        self,
        bins: Complex[np.ndarray, "loop tx rx sample"],
        static: Complex[np.ndarray, "echo tx rx"],
        delays: Float[np.ndarray, "echo"],
        noise: float,
        rng: np.random.Generator,
    ) -> Complex[np.ndarray, "loop tx rx sample"]:
        """Return the sidebands by frequency bin.

        Args:
            bins: Fourier coefficients of the signal without the static echoes.
            static: amplitudes of the leakage and other static echoes before the high-pass filter.
            delays: of those, s.
            noise: power of thermal noise per bin; 0: none.
            rng: random generator of the oscillator's phase.
        """
        loops, tx, rx, n = bins.shape
        # phi is real: Theta at opposite offsets are complex conjugates.
        draw = rng.standard_normal((loops * tx, n - 1, 2), dtype=np.float32).view(np.complex64)[..., 0] * np.sqrt(0.5)
        theta = np.zeros((loops * tx, 2 * n - 1), np.complex64)
        theta[:, n:] = draw
        theta[:, : n - 1] = draw[:, ::-1].conj()
        theta *= 1j * self._level
        weakest = NEGLIGIBLE * noise / np.maximum(self._peak, 1e-30)
        out = np.zeros((loops * tx, rx, n), np.complex64)
        near = (1 - np.exp(-2j * np.pi * np.outer(delays, self._offset[n - 1 :]))) * self._response
        near = np.einsum("etr,em->trm", static, near)
        out += np.tile(near, (loops, 1, 1)) * theta[:, None, n - 1 :]
        _add_sidebands(bins.reshape(loops * tx, rx, n), theta, self._difference, weakest, out)
        return out.reshape(bins.shape)


def density(mask: PhaseNoise, carrier: float, offset: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Single-sideband noise relative to the carrier, 1/Hz, at offsets in Hz."""
    logarithm = np.log10(np.maximum(offset, 1.0))
    # The mask's last slope is extrapolated.
    x, y = np.log10(mask.offset_hz), np.array(mask.dbc_hz)
    level = np.interp(logarithm, x, y)
    if len(x) > 1:
        beyond = np.maximum(logarithm - x[-1], 0)
        level = level + beyond * (y[-1] - y[-2]) / (x[-1] - x[-2])
    return 10 ** ((level + (mask.lower_band_db if carrier < 77e9 else 0.0)) / 10)


@njit(parallel=True, fastmath=True, cache=True)
def _add_sidebands(bins, theta, difference, weakest, out):
    """out[chirp, rx, m] += sum over cells k of bins[chirp, rx, k] theta[chirp, m - k] difference[k, m]."""
    chirps, rx, n = bins.shape
    for c in prange(chirps):
        for k in range(n):
            strongest = np.float32(0)
            for r in range(rx):
                s = bins[c, r, k]
                strongest = max(strongest, s.real * s.real + s.imag * s.imag)
            if strongest <= weakest[k]:
                continue
            sidebands = theta[c, n - 1 - k : 2 * n - 1 - k] * difference[k]
            for r in range(rx):
                s = bins[c, r, k]
                for m in range(n):
                    out[c, r, m] += s * sidebands[m]
