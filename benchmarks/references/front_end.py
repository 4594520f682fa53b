"""References for `tests/receiver/test_frontend.py` and the gallery."""

import numpy as np

from radarize.radar.presets import PRESETS
from radarsim.receiver.frontend import FrontEnd
from radarsim.receiver.frontend_config import FrontEndConfig

CONFIG = PRESETS["radarize"]

PHASE_NOISE = FrontEndConfig.of(CONFIG.board).phase_noise


def db(power):
    return 10 * np.log10(power)


def rng():
    return np.random.default_rng(1)


def tone(beat_bins, level_db, config=CONFIG):
    """Return the beat signal of an echo of `level_db` (received over transmitted power) at a range bin."""
    n = np.arange(config.samples)
    line = 10 ** (level_db / 20) * np.exp(2j * np.pi * beat_bins * n / config.samples)
    return np.broadcast_to(line.astype(np.complex64), config.frame_shape[:-1])


def power_by_bin(counts):
    """Return the mean power per bin over all traces, counts^2."""
    return np.mean(np.abs(np.fft.fft(counts, axis=-1) / counts.shape[-1]) ** 2, axis=(0, 1, 2))


def noise_factor(gain):
    """Return the noise factor at a receive gain (dB): 15.6 dB at 30 dB, 15 dB at 48 dB, by Friis's formula."""
    later = (10**1.56 - 10**1.5) / (10**-3.0 - 10**-4.8)  # noise factor of all that follows the gain
    return 10**1.5 + later * (10 ** (-gain / 10) - 10**-4.8)


def skirt(cell, level_db=-40.0, settings=None, config=CONFIG):
    """Return the power by bin around an echo in a cell, relative to the echo."""
    settings = settings or FrontEndConfig.ideal(phase_noise=PHASE_NOISE)
    counts = FrontEnd(config, settings).receive(tone(cell, level_db, config), rng())
    power = power_by_bin(counts)
    return power / power[cell]


def law(cell, offset_bins, mask_db=lambda f: np.where(f < 316e3, -83, -93 - 20 * np.log10(f / 1e6)), config=CONFIG):
    """Return the phase-noise power per bin, 4 L(f) sin^2(pi f tau) times the width of a bin."""
    step = config.sample_rate / config.samples
    f, tau = np.abs(offset_bins) * step, cell / config.bandwidth
    return 10 ** (mask_db(f) / 10) * 4 * np.sin(np.pi * f * tau) ** 2 * step
