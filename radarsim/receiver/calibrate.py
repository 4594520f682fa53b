"""Calibration of the simulated front end against a few frames of a real radar's recording.

Counts have no absolute scale, so noise figure and receive gain are taken from the data sheet and the configuration,
and the noise floor then gives the converter's full scale. The upper band edge is estimated from the noise spectrum, the
leakage from the lowest range bins, the mount's echo from slightly higher ones, and the channel errors from cells that a
single echo dominates, where the array must observe a plane wave.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Complex, Float
from scipy.optimize import minimize, minimize_scalar

from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.radar.array import virtual_positions
from radarize.radar.boards import load_board
from radarize.radar.config import SPEED_OF_LIGHT, RadarConfig
from radarize.radar.noise import noise_floor, noise_profile
from radarize.radar.windows import periodic
from radarsim.receiver.frontend import BOLTZMANN, ROOM_TEMPERATURE, FrontEnd
from radarsim.receiver.frontend_config import Band, Channel, FrontEndConfig, Leakage, Mismatch, MountEcho, PhaseNoise
from radarsim.receiver.phasenoise import density

#: Smallest number of chirps per transmitter for an estimate of the noise.
FEWEST_LOOPS = 8
#: Delays (s) regarded as leakage; longer ones are echoes.
LEAKAGE_DELAYS = (0.1e-9, 1.2e-9)
#: Fraction of a snapshot's power that one plane wave must explain for an estimate of the channel errors.
DOMINANCE = 0.95
#: Distances (m) regarded as the radar's own mount: beyond the leakage, and nearer than any object in a room.
MOUNT_DISTANCES = (0.1, 0.4)
#: Amplitude relative to the leakage's, both after the high-pass filter, below which an echo may be the leakage's image
#: in an imperfect mixer.
LEFT_OVER = 0.05
_SNAPSHOTS = 60


@dataclass(frozen=True)
class Calibration:
    """Result of a calibration.

    Attributes:
        settings: settings of the front end.
        remarks: sentences on each estimate and its source.
    """

    settings: FrontEndConfig
    remarks: list[str]


def calibrate(recording: Path, output: Path, frames: int = 8) -> Calibration:
    """Fit a front end to a recording and write it as a file for `radarsim simulate --frontend`.

    Args:
        recording: recording of a real radar; a few frames at rest, with one strong echo, are best.
        output: front-end file to write.
        frames: number of frames to use, spread over the recording.

    Raises:
        InputError: no usable recording, too few chirps, or no signal.
    """
    with Recording(recording) as opened:
        config = opened.config
        if not len(opened):
            raise InputError(f"{recording}: has no whole frame, expected at least one")
        if config.loops < FEWEST_LOOPS:
            raise InputError(f"{recording}: has {config.loops} loops a frame, expected at least {FEWEST_LOOPS}")
        chosen = np.unique(np.linspace(0, len(opened) - 1, min(frames, len(opened))).astype(int))
        whole = [k for k in chosen if opened.valid(k, k + 1).all()]
        if not whole:
            raise InputError(f"{recording}: lost samples in all {len(chosen)} frames read, expected a whole one")
        adc = np.concatenate([opened.adc(k, k + 1) for k in whole]).astype(np.float32)
    signal = adc.view(np.complex64)[..., 0]
    found = fit(signal, config, str(recording))
    found.settings.save(output, [f"fitted to {Path(recording).name}", *found.remarks])
    return found


def fit(signal: Complex[np.ndarray, "frame loop tx rx sample"], config: RadarConfig, source: str) -> Calibration:
    """Fit a front end to samples; `source` names their origin in error messages."""
    profile = noise_profile(signal)
    n = config.samples
    flat = slice(n // 10, 8 * n // 10)
    floor = noise_floor(profile)
    if floor <= 2 / 12:
        raise InputError(f"{source}: a noise power of {floor:.3g} counts^2, expected more than the rounding to counts")
    band, fall = band_edge(profile / floor)
    front_end = FrontEnd(config, FrontEndConfig.of(config.board, band=band))
    leak, mount = find_static(signal, front_end, floor)
    # Thermal noise is what remains without the rounding of I and Q and the leakage's phase noise.
    mask = front_end.settings.phase_noise
    thermal = floor - 2 / 12 - (np.median(leak.sidebands(config, mask)[flat]) if leak and mask else 0.0)
    thermal = max(thermal, 0.1 * floor)  # a board may have less phase noise than the mask
    gain, factor = config.rx_gain_db, front_end.settings.noise_factor(config.rx_gain_db)
    dbm = 10 * np.log10(BOLTZMANN * ROOM_TEMPERATURE * config.sample_rate * factor / 1e-3) + gain
    full_scale = round(dbm + 20 * np.log10(32767) - 10 * np.log10(thermal), 2)
    remarks = [
        f"noise {np.sqrt(floor):.2f} counts: full scale {full_scale:.2f} dBm after {gain:g} dB gain, if the noise "
        f"figure is the data sheet's {10 * np.log10(factor):.1f} dB",
        f"band flat to {band.flat:.3f} of the sample rate, noise {fall:.1f} dB down in its last sixteenth",
    ]
    settings = FrontEndConfig.of(config.board, full_scale_dbm=full_scale, band=band, leakage=None, mount=None)
    scale = FrontEnd(config, settings).scale
    static: dict[str, object] = {}
    if leak:
        level, channels = leak.relative(scale, config)
        static["leakage"] = Leakage(level_db=level, delay=round(leak.delay, 12), channels=channels)
        remarks.append(
            f"leakage {level:.1f} dB at {1e9 * leak.delay:.2f} ns before the high-pass filter, "
            f"{leak.heard:.1f} counts behind it"
        )
    else:
        remarks.append("no leakage above the noise")
    if mount:
        level, channels = mount.relative(scale, config)
        distance = round(mount.delay * SPEED_OF_LIGHT / 2, 4)
        static["mount"] = (MountEcho(distance=distance, level_db=level, channels=channels),)
        remarks.append(f"echo of the mount {level:.1f} dB at {distance:.2f} m, {mount.heard:.1f} counts")
    mismatch, remark = fit_channels(signal, config, floor)
    return Calibration(settings.model_copy(update={**static, "mismatch": mismatch}), [*remarks, remark])


def band_edge(profile: Float[np.ndarray, "sample"]) -> tuple[Band, float]:
    """Decimation filter that explains how the noise falls towards the sample rate, and this fall (dB)."""
    n = len(profile)
    x = np.arange(n) / n
    last = slice(n - n // 16, n - 2)  # without the two highest bins, which contain leakage from around zero
    fall = -10 * np.log10(np.mean(profile[last]))
    upper = (x > 0.7) & (np.arange(n) < n - 2)
    measured = 10 * np.log10(profile[upper])
    best, least = Band(), np.inf
    for flat in np.arange(0.8, 1.0, 0.005):
        for high in np.arange(max(flat, 0.98) + 0.02, 1.5, 0.02):
            band = Band(flat=round(float(flat), 3), high=round(float(high), 3))
            misfit = np.mean(np.abs(10 * np.log10(band.noise(x[upper])) - measured))
            if misfit < least:
                best, least = band, misfit
    return best, fall


@dataclass(frozen=True)
class _Static:
    """Static echo in ADC counts.

    Attributes:
        delay: s.
        counts: amplitude of each channel before the high-pass filter.
        heard: mean amplitude after it.
    """

    delay: float
    counts: Complex[np.ndarray, "tx rx"]
    heard: float

    def sidebands(self, config: RadarConfig, mask: PhaseNoise) -> Float[np.ndarray, "sample"]:
        """Power per sample of its phase noise in each range bin, counts^2."""
        f = np.arange(config.samples) * config.sample_rate / config.samples
        noise = density(mask, config.center_frequency, f) * 4 * np.sin(np.pi * f * self.delay) ** 2
        return np.mean(np.abs(self.counts) ** 2) * noise * config.sample_rate

    def relative(self, scale: float, config: RadarConfig) -> tuple[float, tuple[Channel, ...]]:
        """Level (dB) and amplitudes of all channels for the settings; `scale` is counts per unit of amplitude."""
        mean = np.sqrt(np.mean(np.abs(self.counts) ** 2)) / scale
        whole = np.full(config.channel_factors.shape, mean, complex)
        whole[config.channels] = self.counts / scale
        return round(float(20 * np.log10(mean)), 2), tuple(Channel.of(c) for c in whole.ravel())


def find_static(
    signal: Complex[np.ndarray, "frame loop tx rx sample"], front_end: FrontEnd, floor: float
) -> tuple[_Static | None, _Static | None]:
    """Estimate leakage and mount echo: delays and amplitudes of static echoes nearby, apart from a constant offset."""
    config = front_end.config
    static = signal.mean(axis=(0, 1), dtype=complex)
    n = config.samples
    window = periodic(np.hanning, n)
    t = (np.arange(n) - (n - 1) / 2) / config.sample_rate
    bins = max(5, int(np.ceil(MOUNT_DISTANCES[1] / config.range_resolution)) + 2)
    low = np.exp(-2j * np.pi * np.outer(np.arange(bins), np.arange(n)) / n) * window
    seen = static.reshape(-1, n) @ low.T

    def explained(delays: list[float], bins: int) -> tuple[float, Complex[np.ndarray, "echo virtual"]]:
        tones = [np.exp(2j * np.pi * config.slope * delay * t) for delay in delays]
        columns = low[:bins] @ np.stack([*tones, np.ones(n)], axis=1)
        parts, *_ = np.linalg.lstsq(columns, seen[:, :bins].T, rcond=None)
        return np.sum(np.abs(seen[:, :bins].T - columns @ parts) ** 2), parts[:-1]

    def best(span: tuple[float, float], others: list[float], bins: int) -> float:
        delays = np.linspace(*span, 111)
        start = delays[np.argmin([explained([d, *others], bins)[0] for d in delays])]
        near = np.clip([start - delays[1] + delays[0], start + delays[1] - delays[0]], *span)
        return float(minimize_scalar(lambda d: explained([d, *others], bins)[0], bounds=near, method="bounded").x)

    leak = best(LEAKAGE_DELAYS, [], 5)  # the lowest bins contain only leakage
    apart = 0.5 / config.bandwidth  # two tones at a smaller distance could fit anything by cancelling
    nearest, farthest = (2 * distance / SPEED_OF_LIGHT for distance in MOUNT_DISTANCES)
    mount = best((min(max(nearest, leak + apart), farthest), farthest), [leak], bins)
    first, last = LEAKAGE_DELAYS
    leak = best((first, max(first, min(last, mount - apart))), [mount], 5)
    heard = explained([leak, mount], bins)[1].reshape(2, len(config.tx), len(config.rx))
    power = np.mean(np.abs(heard) ** 2, axis=(1, 2))
    weakest = 10 * floor / (n * signal.shape[0] * signal.shape[1])
    echoes = [
        _Static(delay, counts / front_end.beat_response(np.array(config.slope * delay)), float(np.sqrt(p)))
        for delay, counts, p in zip((leak, mount), heard, power, strict=True)
    ]
    above = power >= np.array([weakest, max(weakest, LEFT_OVER**2 * power[0])])
    return echoes[0] if above[0] else None, echoes[1] if above[1] else None


def fit_channels(
    signal: Complex[np.ndarray, "frame loop tx rx sample"], config: RadarConfig, floor: float
) -> tuple[Mismatch, str]:
    """Estimate the channel errors from snapshots dominated by one plane wave. A phase slope over the array cannot be
    distinguished from a direction, so the result has none."""
    antennas = virtual_positions(config).reshape(-1, 3)
    if len(antennas) < 3:
        return Mismatch(), f"{len(antennas)} channels: mismatch left to the data sheet's bounds"
    snapshots = _snapshots(signal, config, floor)
    channel = np.ones(len(antennas), complex)
    dominant = np.zeros(0, int)
    for _ in range(5):
        directions = [_direction(x / channel, antennas, config.wavelength) for x in snapshots]
        share = np.array([d[1] for d in directions])
        dominant = np.flatnonzero(share > DOMINANCE)
        if not len(dominant):
            break
        total = np.zeros(len(antennas), complex)
        for k in dominant:
            steering = _steering(directions[k][0], antennas, config.wavelength)
            wave = np.vdot(steering, snapshots[k] / channel) / len(antennas)
            total += snapshots[k] * np.conj(steering * wave)
        channel = total / np.mean(np.abs(total)) * np.exp(-1j * np.angle(total.sum()))
    if not len(dominant):
        best = f"{100 * share.max():.0f} %" if len(snapshots) else "no echo"
        return Mismatch(), (
            f"no echo outshines all others of its range (best: {best} of the power, needed {100 * DOMINANCE:.0f} %): "
            "mismatch left to the data sheet's bounds"
        )
    whole = np.ones(config.channel_factors.shape, complex)
    whole[config.channels] = channel.reshape(len(config.tx), len(config.rx))
    gain, phase = 20 * np.log10(np.abs(channel)), np.rad2deg(np.angle(channel))
    return Mismatch(channels=[Channel.of(c) for c in whole.ravel()]), (
        f"channels from {len(dominant)} snapshots of single echoes: gain within {np.abs(gain).max():.2f} dB, phase "
        f"within {np.abs(phase).max():.1f} deg of their mean, phase slopes over the array left out"
    )


def _snapshots(
    signal: Complex[np.ndarray, "frame loop tx rx sample"], config: RadarConfig, floor: float
) -> list[Complex[np.ndarray, "virtual"]]:
    """Strongest cells of all frames' range-Doppler maps, corrected for the TDM delays between channels."""
    loops, n = signal.shape[1], config.samples
    slow, fast = periodic(np.hanning, loops), periodic(np.hanning, n)
    cube = np.fft.fft(np.fft.fft(signal * fast, axis=-1) * slow[:, None, None, None], axis=1)
    cycles = np.fft.fftfreq(loops)[:, None] * np.array(config.slot) / config.chirps_per_loop  # a slot's share of a loop
    cube = cube * np.exp(-2j * np.pi * cycles)[:, :, None, None]
    cube = cube * load_board(config.board).signs[config.channels][:, :, None]
    power = np.sum(np.abs(cube) ** 2, axis=(2, 3))
    far = config.ranges > 0.3  # nearer cells contain leakage, or no plane wave
    noise = floor * cube.shape[2] * cube.shape[3] * np.sum(slow**2) * np.sum(fast**2)
    power = power * far * (power > 100 * noise)
    frame, doppler, bin_ = np.unravel_index(np.argsort(power, axis=None)[::-1][:_SNAPSHOTS], power.shape)
    keep = power[frame, doppler, bin_] > 0
    return [cube[f, d, :, :, b].ravel() for f, d, b in zip(frame[keep], doppler[keep], bin_[keep], strict=True)]


def _steering(
    sines: Float[np.ndarray, "2"], antennas: Float[np.ndarray, "virtual 3"], wavelength: float
) -> Complex[np.ndarray, "virtual"]:
    return np.exp(-2j * np.pi / wavelength * (antennas[:, 1:] @ sines))


def _direction(
    snapshot: Complex[np.ndarray, "virtual"], antennas: Float[np.ndarray, "virtual 3"], wavelength: float
) -> tuple[Float[np.ndarray, "2"], float]:
    """Direction (sines to the left and up) of the plane wave that explains most of a snapshot, and the fraction
    explained."""

    def unexplained(sines):
        response = np.vdot(_steering(np.asarray(sines), antennas, wavelength), snapshot)
        return 1 - np.abs(response) ** 2 / (len(antennas) * np.sum(np.abs(snapshot) ** 2))

    grid = [(a, b) for a in np.linspace(-0.9, 0.9, 61) for b in np.linspace(-0.5, 0.5, 11)]
    steering = np.exp(2j * np.pi / wavelength * (np.array(grid) @ antennas[:, 1:].T))
    start = grid[int(np.argmax(np.abs(steering @ snapshot)))]
    found = minimize(unexplained, start, method="Nelder-Mead", options={"xatol": 1e-5, "fatol": 1e-9})
    return found.x, 1 - float(found.fun)
