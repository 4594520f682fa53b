"""Faults in the decoding of samples: order of I and Q, of receivers within a chirp, of bytes, of chirps.

Samples in their correct order have sharp peaks over range and Doppler; in a wrong order, parts of several chirps or of
I and Q alternate, and each peak splits into many. The correct order is therefore the one with the least entropy of the
power spectrum, as in autofocus of synthetic aperture radar. I and Q exchanged keep the peaks sharp and mirror range,
Doppler and azimuth together: then the transmitters' leakage, the nearest of all echoes, is at negative range.
"""

from collections.abc import Callable, Iterator

import numpy as np
import scipy.fft

from radarize.pipeline.check.evidence import Evidence
from radarize.pipeline.check.finding import Correction, Finding, NotObservable
from radarize.pipeline.check.levels import sureness
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import encode
from radarize.signal.snapshots import NEAREST

#: Nats by which the entropy with another order must be less.
_LESS = 0.25
#: dB by which leakage at positive and negative range must differ; at least 19 in public captures of three boards.
_LEAKS = 6.0
#: m, largest range of leakage.
_LEAKAGE = 0.3
_ASKED = 4

Reading = Callable[[np.ndarray], np.ndarray]


def readings(config: RadarConfig) -> dict[str, tuple[str, Reading]]:
    """Return other orders of the same words by name: the remedy, and a function that reorders frames."""
    loops, tx, rx, samples, _ = config.frame_shape

    def words(frames: np.ndarray) -> np.ndarray:
        """Return words in the order of capture."""
        return encode(frames, config).reshape(len(frames), loops, tx, -1)

    def physical(chirps: np.ndarray) -> np.ndarray:
        return np.ascontiguousarray(chirps[:, :, list(config.slot)])

    def lanes(frames: np.ndarray) -> np.ndarray:
        chirps = words(frames).reshape(-1, loops, tx, samples, 2, rx).transpose(0, 1, 2, 5, 3, 4)
        return physical(chirps[..., ::-1] if config.iq_order == "qqii" else chirps)

    def alternating(frames: np.ndarray) -> np.ndarray:
        chirps = words(frames).reshape(-1, loops, tx, rx, samples, 2)
        return physical(chirps[..., ::-1] if config.iq_order == "qqii" else chirps)

    def swapped_bytes(frames: np.ndarray) -> np.ndarray:
        return frames.byteswap()

    def transmitter_by_transmitter(frames: np.ndarray) -> np.ndarray:
        fired = frames[:, :, [config.tx.index(t) for t in config.tx_order]]
        chirps = fired.reshape(len(frames), tx, loops, rx, samples, 2).swapaxes(1, 2)
        return physical(chirps)

    found: dict[str, tuple[str, Reading]] = {"byte order": ("swap the bytes of each word", swapped_bytes)}
    if not samples % 2:
        found["layout"] = ("import it with --layout interleaved", lanes) if rx > 1 else ("", alternating)
        found["layout of I and Q"] = ("import it as I0 Q0 I1 Q1, not in pairs (I0 I1 Q0 Q1)", alternating)
    if rx == 1:
        found.pop("layout", None)
    if tx > 1 and loops > 1:
        found["loops and chirps"] = (
            "give --shape with tx before loop: all chirps of a transmitter come first", transmitter_by_transmitter
        )  # fmt: skip
    return found


def order_of_words(evidence: Evidence) -> Iterator[Finding]:
    """Find another order of words with much sharper spectra."""
    some = evidence.samples[:: max(len(evidence.samples) // _ASKED, 1)][:_ASKED]
    first = max(int(np.searchsorted(evidence.config.ranges, NEAREST)), 1)
    here = entropies(some, first)
    less = {}
    for kind, (_, reading) in readings(evidence.config).items():
        # Errors within a chirp blur range, errors among chirps blur Doppler.
        less[kind] = float((here - entropies(reading(some), first)).sum())
    kind = max(less, key=lambda name: less[name])
    if less[kind] > _LESS:
        remedy, reading = readings(evidence.config)[kind]
        yield Finding(
            kind, f"the entropy of range and Doppler is {less[kind]:.2f} nats less in another order",
            sureness(less[kind], _LESS), remedy, Correction(samples=reading), hides=True,
        )  # fmt: skip


def entropies(frames: np.ndarray, first: int) -> np.ndarray:
    """Return entropies of power over range and over Doppler, nats; Doppler at ranges from bin `first` on."""
    signal = np.ascontiguousarray(frames, np.float32).view(np.complex64)[..., 0]
    loops, samples = signal.shape[1], signal.shape[-1]
    profile = scipy.fft.fft(signal * np.hanning(samples).astype(np.float32), axis=-1)
    doppler = scipy.fft.fft(profile * np.hamming(loops).astype(np.float32)[:, None, None, None], axis=1)
    over_range = np.square(np.abs(profile)).mean(axis=(1, 2, 3))
    power = np.square(np.abs(doppler)).mean(axis=(2, 3))
    inside = power[:, :, first : samples - first]
    # The entropy over Doppler of each range alone, weighted by power, so that the range profile has no influence.
    return np.array([_entropy(over_range).mean(), _entropy(inside.mean(axis=2)).mean()])


def _entropy(power: np.ndarray) -> np.ndarray:
    share = power / np.maximum(power.sum(axis=-1, keepdims=True), 1e-30)
    return -(share * np.log(np.maximum(share, 1e-30))).sum(axis=-1)


def i_and_q(evidence: Evidence) -> Iterator[Finding]:
    """Find transmitter leakage at negative range."""
    config = evidence.config
    power = np.median(np.square(np.abs(evidence.profiles)), axis=(0, 1))
    levels = 10 * np.log10(power.reshape(-1, power.shape[-1]) + 1e-12)
    reach = max(int(np.searchsorted(config.ranges, _LEAKAGE)), 2)
    # The median over channels, because a stuck channel has all its power at zero.
    leak = float(np.median(levels[:, 1 : reach + 1].max(axis=1) - levels[:, -reach:].max(axis=1)))
    if abs(leak) < _LEAKS:
        raise NotObservable(f"levels at positive and at negative range near zero differ by {leak:.1f} dB only")
    if leak < 0:
        other = "iiqq" if config.iq_order == "qqii" else "qqii"
        yield Finding(
            "I and Q", f"leakage at negative range is {-leak:.0f} dB stronger than at positive range",
            sureness(-leak, _LEAKS), f"import it with --iq-order {other}: I and Q are exchanged",
            Correction(samples=lambda frames: np.ascontiguousarray(frames[..., ::-1])), hides=True,
        )  # fmt: skip
