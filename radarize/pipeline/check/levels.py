"""Faults that show in the numbers themselves, whatever the world: broken channels, spoilt samples."""

from collections.abc import Iterator

import numpy as np

from radarize.pipeline.check.evidence import Evidence
from radarize.pipeline.check.finding import Correction, Finding, NotObservable
from radarize.radar.config import firing_name
from radarize.radar.noise import noise_floor, noise_profile

#: Frames of which single samples are looked at: every so many-th.
RARE = 4
#: A channel is dead whose power is less than this share of the median channel's.
_DEAD = 1 / 30
#: Share of a receiver's samples at its own largest magnitude: one that is not clipped has a few of them, unless all are
#: within some counts.
_CLIPPED, _SMALL = 1e-3, 16
#: Two channels hold the same samples if this share of them is equal; by chance it is 1/50 at most.
_SAME = 0.9
#: Power of the image over that of the signal: data sheet of the IWR1843, -30 dB.
_IMAGE = 0.1
#: Strongest over median range bin of pure noise, at most.
_FLAT = 2.0
#: Counts, standard deviation of I or Q, below which rounding (0.29) takes part of what the converter measured.
_ROUGH = 0.6


def sureness(value: float, threshold: float) -> float:
    """0.5 for a value at its threshold, towards 1 far beyond it."""
    return float(1 - 0.5 ** max(value / threshold, 1.0))


def _decibels(power: float, usual: float) -> float:
    return float(10 * np.log10(max(power, 1e-9) / usual))


def silence(evidence: Evidence) -> Iterator[Finding]:
    """All samples are equal, or there are none."""
    if not evidence.samples.size or not np.ptp(evidence.samples):
        yield Finding(
            "no signal", f"all samples of {len(evidence.chosen)} frames are equal", 1.0,
            "look at the cable and at the settings of LVDS (lvdsStreamCfg)", hides=True,
        )  # fmt: skip


def offset_binary(evidence: Evidence) -> Iterator[Finding]:
    """Words count from -32768 on: what is near zero reads near the ends, and little in between."""
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
    """No range holds more than any other."""
    peak = float(evidence.levels.max() / max(np.median(evidence.levels), 1e-30))
    if peak < _FLAT:
        yield Finding(
            "pure noise", f"the strongest range is {10 * np.log10(peak):.1f} dB above the median of all",
            sureness(_FLAT / peak, 1.0), "look whether the transmitters are on (channelCfg, chirpCfg), and at --layout",
            hides=True,
        )  # fmt: skip


def receivers(evidence: Evidence) -> Iterator[Finding]:
    """Receivers that are dead, stuck, clipped or copies of another one."""
    frames, rx = evidence.samples[::RARE], evidence.config.rx
    moving = frames.astype(np.float32)
    moving -= moving.mean(axis=4, keepdims=True)
    power = np.square(moving).mean(axis=(0, 1, 2, 4, 5))
    usual = max(float(np.median(power)), 1e-30)
    for k in np.flatnonzero(power < _DEAD * usual):
        yield Finding(
            "receiver dead", f"RX{rx[k] + 1} has {_decibels(power[k], usual):.0f} dB of the others' power",
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
                sureness(share, _CLIPPED), "lower the receivers' gain (profileCfg), or move what reflects nearby",
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
            "channels identical", f"all {len(rx)} receivers hold the same samples", 1.0,
            "look at what made the file: one receiver was written for all", hides=True,
        )  # fmt: skip
        return
    for a, b in pairs:
        yield Finding(
            "receiver copied", f"RX{rx[b] + 1} holds the samples of RX{rx[a] + 1}", 1.0,
            f"look at what made the file, or leave RX{rx[b] + 1} out",
        )  # fmt: skip
    for a, b in copied:
        yield Finding(
            "transmitter copied", f"the chirps of {firing_name(tx[b])} are those of {firing_name(tx[a])}", 1.0,
            "look at what made the file",
        )  # fmt: skip


def transmitters(evidence: Evidence) -> Iterator[Finding]:
    """Transmitters whose chirps bring no echoes."""
    tx = evidence.config.tx
    if len(tx) < 2:
        raise NotObservable("a single transmitter has nothing to be compared with")
    power = np.square(np.abs(evidence.cells.channels)).sum(axis=(0, 2)).astype(float)
    usual = float(power.max())
    for k in np.flatnonzero(power < _DEAD * usual):
        yield Finding(
            "transmitter dead", f"echoes of {firing_name(tx[k])} have {_decibels(power[k], usual):.0f} dB of the most",
            sureness(_DEAD * usual / max(power[k], 1e-9), 1.0),
            f"look at txEnable in chirpCfg and at the board, or leave {firing_name(tx[k])} out (--tx)",
        )  # fmt: skip


def one_of_two(evidence: Evidence) -> Iterator[Finding]:
    """Q holds nothing, or what I holds."""
    real, imaginary = np.moveaxis(evidence.samples[::RARE], -1, 0)
    empty = [name for name, part in (("I", real), ("Q", imaginary)) if not np.ptp(part)]
    if empty or float((real == imaginary).mean()) > _SAME:
        yield Finding(
            "I without Q", f"{empty[0]} is constant" if empty else "Q holds the samples of I", 1.0,
            "sample complex (adcCfg 2 1), or import real samples with --layout real", hides=True,
        )  # fmt: skip


def image(evidence: Evidence) -> Iterator[Finding]:
    """Each echo has an image at negative range: one of I and Q is missing, or both are the same."""
    spectrum = evidence.profiles
    mirrored = np.roll(spectrum[..., ::-1], 1, axis=-1)
    inner = slice(1, spectrum.shape[-1] // 2)
    product = np.abs((spectrum * mirrored)[..., inner].sum(axis=-1)).mean()
    power = np.square(np.abs(spectrum[..., inner])).sum(axis=-1).mean()
    other = np.square(np.abs(mirrored[..., inner])).sum(axis=-1).mean()
    share = float(product / max(power, other, 1e-30))
    if share > _IMAGE**0.5:
        yield Finding(
            "I without Q", f"images at negative range have {20 * np.log10(share):.0f} dB of the echoes' power",
            sureness(share, _IMAGE**0.5), "sample complex (adcCfg 2 1), or import real samples with --layout real",
            hides=True,
        )  # fmt: skip


def scaled(evidence: Evidence) -> Iterator[Finding]:
    """All samples are multiples of a number, or so small that rounding took part of them."""
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
            "samples scaled", f"noise has a standard deviation of {quiet:.2f} counts, less than rounding leaves whole",
            sureness(_ROUGH / max(quiet, 0.05), 1.0), "keep the converter's 16 bits: the samples were divided",
        )  # fmt: skip
