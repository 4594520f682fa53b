"""Synthesis of a burst's beat signal from echoes, with exact phases for every chirp, TDM slot and antenna.

The beat signal of virtual antenna (k, r), loop l, sample n is a sum over echoes e with path length L (out and back),

    s = sum_e A_e exp(j 2 pi [ (f_c / c) L - S L^2 / (2 c^2) + ((S / c) L + (f_c / c) dL/dt) (t_n - t_c) ])

with L taken when the middle of the chirp's ADC window passes: range walk, TDM slots and near field are in L, and the
motion during the ramp is in dL/dt (range-Doppler coupling). The term in L^2 is the residual video phase (Stove, IEE
Proc. F 139(5), 1992). A direct sum costs echoes x traces x samples. Here the three dimensions come apart:

1. L of each echo and virtual antenna is a parabola in time through three instants of the burst (its third-order rest
   is below 10 um for anything a person carries), so the phase of a trace is a polynomial in the loop number.
2. The tone along the samples has a frequency of b bins, b = (S L + f_c dL/dt) N / (c f_s). Each echo joins the cell
   g = round(b); what is left, |b - g| <= w, is expanded as Jacobi and Anger did:
       exp(j x u v) = sum_p i_p J_p(x v) T_p(u),  i_0 = 1, i_p = 2 j^p,
       u = (b - g) / w,  v = (n - n_c) / (N / 2),  x = pi w,
   which converges faster than exponentially. So an echo adds `orders` numbers per trace to its cell, whatever the
   number of samples,
3. and a discrete Fourier transform over the cells, once per order, gives the samples. Beat frequencies beyond the
   sample rate alias, as they do in the converter.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float
from numba import njit, prange
from scipy.special import jv

from radarize.radar.config import SPEED_OF_LIGHT, RadarConfig
from radarsim.propagation.burst import BurstClock

#: Loops summed together in the processor's SIMD registers.
LANES = 16


class Synthesizer:
    """Synthesizer of the beat signal of a burst from path-length parabolas and amplitudes.

    Args:
        config: radar configuration.
        accuracy: bound on the amplitude error of the expansion at the worst sample of the worst echo, relative to that
            echo. All samples of all echoes together are 20 dB better.
    """

    def __init__(self, config: RadarConfig, accuracy: float = 4e-3):
        self.config = config
        self.accuracy = accuracy
        clock = BurstClock.of(config)
        first = (config.chirp_times[0] - clock.middle) / clock.half
        self._axes = _Axes(
            start=np.repeat(first, len(config.rx)), step=config.loop_time / clock.half, loops=config.loops,
            samples=config.samples, per_metre=1 / (2 * config.range_resolution),
            per_rate=config.center_frequency / SPEED_OF_LIGHT * config.samples / config.sample_rate / clock.half,
            wavenumber=config.center_frequency / SPEED_OF_LIGHT, video=config.slope / (2 * SPEED_OF_LIGHT**2),
        )  # fmt: skip
        n = config.samples
        # Sample instants v = -1...1 within the window: the upper half and the middle.
        self._v = (np.arange(n // 2, n) - (n - 1) / 2) / (n / 2)
        self._dft = np.exp(1j * np.pi * np.arange(n) * self._v[:, None]).astype(np.complex64)

    def __call__(
        self, lengths: Float[np.ndarray, "echo virtual 3"], amplitudes: Complex[np.ndarray, "echo"]
    ) -> Complex[np.ndarray, "loop tx rx sample"]:
        """Beat signal of a burst.

        Args:
            lengths: path length per echo and virtual antenna (tx-major), m, as a parabola in normalised time.
            amplitudes: square root of power, with the phase of reflection and scattering.

        Returns:
            complex64 in the amplitudes' unit.
        """
        config = self.config
        loops, tx, rx, n, _ = config.frame_shape
        if not len(amplitudes):
            return np.zeros((loops, tx, rx, n), np.complex64)
        cells, waves, off = _waves(lengths, amplitudes, self._axes)
        width = max(0.5, off.max())
        orders = self._orders(np.pi * width)
        cells = (cells % n).astype(np.uint16)  # NumPy sorts 16 bits in linear time
        order = np.argsort(cells, kind="stable")
        edges = np.searchsorted(cells[order], np.arange(n + 1))
        moments = np.zeros((n, orders, tx * rx, loops, 2), np.float32)
        size = np.abs(amplitudes).astype(np.float32)
        _accumulate(moments, edges, order, size, waves, np.float32(1 / width), (0.0,) * orders)
        return self._samples(moments, np.pi * width)

    def _orders(self, x: float) -> int:
        """Number of terms after which the remainder of the Jacobi-Anger series is below `accuracy`."""
        orders = np.arange(1, 200)
        return int(orders[2 * np.abs(jv(orders, x)) + 2 * np.abs(jv(orders + 1, x)) < self.accuracy][0])

    def _samples(self, moments: np.ndarray, x: float) -> Complex[np.ndarray, "loop tx rx sample"]:
        loops, tx, rx, n, _ = self.config.frame_shape
        orders = moments.shape[1]
        p = np.arange(orders)
        basis = np.where(p == 0, 1, 2) * 1j**p * jv(p, x * self._v[:, None])  # sample, order
        # One matrix product: the transform over cells and the sum over orders are both sums over (cell, order). The
        # kernel at -v is the conjugate of that at v, so real and imaginary parts at v >= 0 give both halves.
        kernel = (self._dft[:, :, None] * basis[:, None, :].astype(np.complex64)).reshape(-1, n * orders)
        parts = np.concatenate([kernel.real, kernel.imag]) @ moments.reshape(n * orders, -1)
        real, imaginary = parts.view(np.complex64).reshape(2, len(kernel), tx, rx, loops)
        out = np.empty((n, tx, rx, loops), np.complex64)
        out[n // 2 :] = real + 1j * imaginary
        out[: len(kernel)] = (real - 1j * imaginary)[::-1]
        return out.transpose(3, 1, 2, 0)


class _Axes(NamedTuple):
    """Normalised time s of loop 0 per virtual antenna, and between loops; bins per m, and per m of dL/ds; cycles per m
    of the carrier, and per m^2 of the residual video phase."""

    start: Float[np.ndarray, "virtual"]
    step: float
    loops: int
    samples: int
    per_metre: float
    per_rate: float
    wavenumber: float
    video: float


@njit(parallel=True, cache=True)
def _waves(lengths, amplitudes, axes):
    """Cell of each echo; parabolas over the loop number of its phase (cycles) and of its tone relative to the cell
    (bins), by echo, coefficient (three of each) and antenna; and the largest distance of a tone from its cell.

    Cells repeat after N bins, but phases refer to the instant n_c = (N - 1) / 2, at which a tone N bins higher has
    turned n_c cycles further.
    """
    echoes, virtual, _ = lengths.shape
    step = axes.step
    cells, off = np.empty(echoes, np.int64), np.zeros(echoes)
    waves = np.empty((echoes, 6, virtual), np.float32)
    for e in prange(echoes):
        middle = 0.0
        for a in range(virtual):
            middle += lengths[e, a, 0] * axes.per_metre + lengths[e, a, 1] * axes.per_rate
        cell = np.floor(middle / virtual + 0.5)
        cells[e] = np.int64(cell)
        turn = np.arctan2(amplitudes[e].imag, amplitudes[e].real) / (2 * np.pi)
        turn -= cells[e] // axes.samples * ((axes.samples - 1) / 2)
        for a in range(virtual):
            c0, c1, c2 = lengths[e, a, 0], lengths[e, a, 1], lengths[e, a, 2]
            s = axes.start[a]
            # The residual video phase is nearly linear over a burst. float64 only for the large part of the phase.
            wavenumber = axes.wavenumber - 2 * axes.video * c0
            p0 = turn + axes.video * c0 * c0 + wavenumber * (c0 + s * (c1 + s * c2))
            waves[e, 0, a] = p0 - np.floor(p0)
            waves[e, 1, a] = wavenumber * step * (c1 + 2 * s * c2)
            waves[e, 2, a] = wavenumber * step * step * c2
            t0 = c0 * axes.per_metre + c1 * axes.per_rate - cell
            t1 = c1 * axes.per_metre + 2 * c2 * axes.per_rate
            t2 = c2 * axes.per_metre
            waves[e, 3, a] = t0 + s * (t1 + s * t2)
            waves[e, 4, a] = step * (t1 + 2 * s * t2)
            waves[e, 5, a] = step * step * t2
        for a in range(virtual):
            t0, t1, t2, last = waves[e, 3, a], waves[e, 4, a], waves[e, 5, a], axes.loops - 1
            off[e] = max(off[e], abs(t0), abs(t0 + last * (t1 + last * t2)))
    return cells, waves, off


@njit(parallel=True, fastmath=True, cache=True)
def _accumulate(moments, edges, order, sizes, waves, scale, series):
    """moments[cell, p, antenna, loop] += A exp(j phase) T_p(u), over the echoes of each cell.

    `series` is a tuple with one entry per order: its length is known at compilation, so all orders of a few loops stay
        in
    registers.
    """
    n, orders, virtual, loops, _ = moments.shape
    blocks = -(-loops // LANES)
    for i in prange(n):
        # Threads get contiguous ranges of i; near cells hold few echoes, so cells are distributed alternately.
        cell = 2 * i if 2 * i < n else 2 * (i - (n + 1) // 2) + 1
        if edges[cell] == edges[cell + 1]:
            continue
        acc = np.zeros((virtual, blocks, len(series), 2, LANES), np.float32)
        for j in range(edges[cell], edges[cell + 1]):
            e = order[j]
            for a in range(virtual):
                wave = sizes[e], waves[e, 0, a], waves[e, 1, a], waves[e, 2, a]
                tone = waves[e, 3, a] * scale, waves[e, 4, a] * scale, waves[e, 5, a] * scale
                for block in range(blocks):
                    _add(acc[a, block], np.float32(block * LANES), wave, tone, series)
        for p in range(orders):
            for a in range(virtual):
                for loop in range(loops):
                    moments[cell, p, a, loop, 0] = acc[a, loop // LANES, p, 0, loop % LANES]
                    moments[cell, p, a, loop, 1] = acc[a, loop // LANES, p, 1, loop % LANES]


@njit(inline="always", fastmath=True)
def _add(acc, first, wave, tone, series):
    """Add one echo at one antenna in some loops to the real and imaginary parts of all orders."""
    size, p0, p1, p2 = wave
    u0, u1, u2 = tone
    for lane in range(LANES):
        k = first + np.float32(lane)
        x = p0 + k * (p1 + k * p2)
        x -= np.floor(x + np.float32(0.5))
        sine, cosine = _sincos_cycles(x)
        re, im = size * cosine, size * sine
        u = u0 + k * (u1 + k * u2)
        before, now = u, np.float32(1)
        for p in range(len(series)):
            acc[p, 0, lane] += re * now
            acc[p, 1, lane] += im * now
            before, now = now, np.float32(2) * u * now - before


@njit(inline="always", fastmath=True)
def _sincos_cycles(x):
    """sin and cos of 2 pi x for |x| <= 1/2, float32, error below 1e-6: polynomials that the compiler vectorises."""
    y = x * x
    sine = x * (
        np.float32(6.28318492)
        + y * (np.float32(-41.34158923) + y * (np.float32(81.59994333) + y * (np.float32(-76.61447253)
        + y * (np.float32(41.34288235) + y * np.float32(-12.47124353)))))
    )  # fmt: skip
    cosine = (
        np.float32(0.99999921)
        + y * (np.float32(-19.73898036) + y * (np.float32(64.92865742) + y * (np.float32(-85.27162153)
        + y * (np.float32(58.79049212) + y * np.float32(-21.07110563)))))
    )  # fmt: skip
    return sine, cosine
