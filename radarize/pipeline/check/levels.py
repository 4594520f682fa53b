"""Faults that the sample values show without any model of the world: broken channels, damaged samples."""

from collections.abc import Iterator

import numpy as np

from radarize.pipeline.check.evidence import Evidence
from radarize.pipeline.check.finding import Correction, Finding, NotObservable
from radarize.radar.config import firing_name
from radarize.radar.noise import noise_floor, noise_profile

#: Single samples are examined in every N-th frame.
RARE = 4
#: A channel is dead if its power is below this share of the median channel's.
_DEAD = 1 / 30
#: A receiver is clipped if this share of its samples is at its largest magnitude, unless that is below this count.
_CLIPPED, _SMALL = 1e-3, 16
#: Two channels have the same samples if this share of them is equal; by chance it is at most 1/50.
_SAME = 0.9
#: Power ratio of image and signal; -30 dB in the data sheet of the IWR1843.
_IMAGE = 0.1
#: Maximum ratio of the strongest to the median range bin in pure noise.
_FLAT = 2.0
#: Counts, standard deviation of I or Q below which rounding (0.29) removes information.
_ROUGH = 0.6


def sureness(value: float, threshold: float) -> float:
    """Return the confidence: 0.5 for a value at its threshold, towards 1 far above it."""
    return float(1 - 0.5 ** max(value / threshold, 1.0))


def _decibels(power: float, usual: float) -> float:
    return float(10 * np.log10(max(power, 1e-9) / usual))


def silence(evidence: Evidence) -> Iterator[Finding]:
    """Find recordings in which all samples are equal, or missing."""
    if not evidence.samples.size or not np.ptp(evidence.samples):
        yield Finding(
            "no signal", f"all samples of {len(evidence.chosen)} frames are equal", 1.0,
            "check the cable and the LVDS settings (lvdsStreamCfg)", hides=True,
        )  # fmt: skip


def offset_binary(evidence: Evidence) -> Iterator[Finding]:
    """Find words that count from -32768: values near zero are near the ends of the range, and few are in between."""
    some = evidence.samples[::RARE]
    far = float(np.mean((some > 16384) | (some < -16384)))
    both = min(float((some > 16384).mean()), float((some < -16384).mean()))
    if far > 0.9 and both > 0.1:
        yield Finding(
            "offset-binary samples", f"{far:.0%} of the samples lie beyond half of full scale, on both sides",
            sureness(far, 0.9), "import it with --encoding offset-binary",
            Correction(samples=lambda frames: frames ^ np.int16(-32768)), hides=True,
        )  # fmt: skip


def noise(evidence: Evidence) -> Iterator[Finding]:
    """Find recordings in which no range has more power than the others."""
    peak = float(evidence.levels.max() / max(np.median(evidence.levels), 1e-30))
    if peak < _FLAT:
        yield Finding(
            "pure noise", f"the strongest range is {10 * np.log10(peak):.1f} dB above the median of all",
            sureness(_FLAT / peak, 1.0), "check that the transmitters are on (channelCfg, chirpCfg), and --layout",
            hides=True,
        )  # fmt: skip


def receivers(evidence: Evidence) -> Iterator[Finding]:
    """Find receivers that are dead, stuck, clipped or copies of another one."""
    frames, rx = evidence.samples[::RARE], evidence.config.rx
    moving = frames.astype(np.float32)
    moving -= moving.mean(axis=4, keepdims=True)
    power = np.square(moving).mean(axis=(0, 1, 2, 4, 5))
    usual = max(float(np.median(power)), 1e-30)
    for k in np.flatnonzero(power < _DEAD * usual):
        yield Finding(
            "receiver dead", f"RX{rx[k] + 1} is at {_decibels(power[k], usual):.0f} dB relative to the median receiver",
            sureness(_DEAD * usual / max(power[k], 1e-9), 1.0), f"repair RX{rx[k] + 1}, or leave it out (channelCfg)",
        )  # fmt: skip
    dead = power < _DEAD * usual
    for place in np.flatnonzero(~dead):
        each = np.abs(frames[:, :, :, place].astype(np.int32))
        peak = int(each.max())
        share = float((each == peak).mean())
        if peak > _SMALL and share > _CLIPPED:
            yield Finding(
                "receiver saturated", f"{share:.2%} of the samples of RX{rx[place] + 1} are at {peak} counts",
                sureness(share, _CLIPPED), "lower the receivers' gain (profileCfg), or remove nearby reflectors",
            )  # fmt: skip
    yield from _copies(frames, dead, evidence)


def _copies(frames: np.ndarray, dead: np.ndarray, evidence: Evidence) -> Iterator[Finding]:
    tx, rx = evidence.config.tx, evidence.config.rx
    channels = np.moveaxis(frames, (2, 3), (0, 1))  # (tx, rx, frame, loop, sample, iq)

    def same(one: np.ndarray, other: np.ndarray) -> bool:
        return bool(np.ptp(one)) and float((one == other).mean()) > _SAME

    pairs = [(a, b) for b in range(len(rx)) for a in range(b) if same(channels[:, a], channels[:, b])]
    copied = [(a, b) for b in range(len(tx)) for a in range(b) if same(channels[a], channels[b])]
    if len(rx) > 1 and len(pairs) == len(rx) * (len(rx) - 1) // 2:
        yield Finding(
            "channels identical", f"all {len(rx)} receivers have the same samples", 1.0,
            "check the program that wrote the file: it wrote one receiver for all", hides=True,
        )  # fmt: skip
        return
    for a, b in pairs:
        yield Finding(
            "receiver copied", f"RX{rx[b] + 1} has the samples of RX{rx[a] + 1}", 1.0,
            f"check the program that wrote the file, or leave RX{rx[b] + 1} out",
        )  # fmt: skip
    for a, b in copied:
        yield Finding(
            "transmitter copied", f"the chirps of {firing_name(tx[b])} are those of {firing_name(tx[a])}", 1.0,
            "check the program that wrote the file",
        )  # fmt: skip


def transmitters(evidence: Evidence) -> Iterator[Finding]:
    """Find transmitters whose chirps have no echoes."""
    tx = evidence.config.tx
    if len(tx) < 2:
        raise NotObservable("there is a single transmitter, so none to compare with")
    power = np.square(np.abs(evidence.cells.channels)).sum(axis=(0, 2)).astype(float)
    usual = float(power.max())
    for k in np.flatnonzero(power < _DEAD * usual):
        yield Finding(
            "transmitter dead",
            f"echoes of {firing_name(tx[k])} are {-_decibels(power[k], usual):.0f} dB below those of the strongest",
            sureness(_DEAD * usual / max(power[k], 1e-9), 1.0),
            f"check txEnable in chirpCfg and the board, or leave {firing_name(tx[k])} out (--tx)",
        )  # fmt: skip


def one_of_two(evidence: Evidence) -> Iterator[Finding]:
    """Find Q samples that are constant or equal to I."""
    real, imaginary = np.moveaxis(evidence.samples[::RARE], -1, 0)
    empty = [name for name, part in (("I", real), ("Q", imaginary)) if not np.ptp(part)]
    if empty or float((real == imaginary).mean()) > _SAME:
        yield Finding(
            "I without Q", f"{empty[0]} is constant" if empty else "Q has the samples of I", 1.0,
            "sample complex (adcCfg 2 1), or import real samples with --layout real", hides=True,
        )  # fmt: skip


def image(evidence: Evidence) -> Iterator[Finding]:
    """Find images of echoes at negative range: I or Q is missing, or both are the same."""
    spectrum = evidence.profiles
    mirrored = np.roll(spectrum[..., ::-1], 1, axis=-1)
    inner = slice(1, spectrum.shape[-1] // 2)
    product = np.abs((spectrum * mirrored)[..., inner].sum(axis=-1)).mean()
    power = np.square(np.abs(spectrum[..., inner])).sum(axis=-1).mean()
    other = np.square(np.abs(mirrored[..., inner])).sum(axis=-1).mean()
    share = float(product / max(power, other, 1e-30))
    if share > _IMAGE**0.5:
        yield Finding(
            "I without Q", f"images at negative range are at {20 * np.log10(share):.0f} dB relative to the echoes",
            sureness(share, _IMAGE**0.5), "sample complex (adcCfg 2 1), or import real samples with --layout real",
            hides=True,
        )  # fmt: skip


def scaled(evidence: Evidence) -> Iterator[Finding]:
    """Find samples that are all multiples of a number, or so small that rounding removed information."""
    some = np.abs(evidence.samples[::RARE].astype(np.int64))
    factor = int(np.gcd.reduce(some[some > 0]))
    if factor > 1:
        yield Finding(
            "samples scaled", f"all samples are multiples of {factor}", 1.0, f"divide them by {factor}",
            Correction(samples=lambda frames: frames // np.int16(factor)),
        )  # fmt: skip
        return
    signal = np.ascontiguousarray(evidence.samples[::RARE], np.float32).view(np.complex64)[..., 0]
    quiet = float(np.sqrt(noise_floor(noise_profile(signal)) / 2))
    if quiet < _ROUGH:
        yield Finding(
            "samples scaled", f"noise has a standard deviation of {quiet:.2f} counts, so rounding removed information",
            sureness(_ROUGH / max(quiet, 0.05), 1.0), "keep the 16 bits of the ADC: the samples were divided",
        )  # fmt: skip
