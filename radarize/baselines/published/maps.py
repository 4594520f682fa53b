"""Heat maps as in the published artefact.

They differ from the default maps on purpose:

- Channel calibration is applied in the order in which transmitters fire, so the factors of TX2 and TX3 are exchanged.
- The phase of moving targets between TDM slots is not compensated. There are no windows and no diagonal loading.
- Slow time is three bursts in sequence, without the pauses between them.
- Doppler-azimuth maps treat all twelve channels as one line of antennas half a wavelength apart.
- Range-azimuth maps fill the channels that a chirp does not measure with zeros. The covariance then has no
  cross-products between TX1 and TX3, and consists of two blocks of four antennas.
- Covariances are divided by twice the number of loops: a loop counts as two chirps, for the row of eight (correct) and
  for the elevation-aware array of four (whose second chirp is zero).
- Doppler-azimuth maps are mirrored in both axes: rows ascend with *opening* speed, columns to the right.
- The first frames have no maps, until the longest buffer is full. The artefact starts with the third frame, and gives
  it and the fourth the five-frame maps of the fifth, which a stream cannot do.

Maps agree with those of the artefact's code within 1e-4 (tests/baselines/test_published_golden.py), except some of 100
cells in range bins with echoes 40 dB above the noise, where the artefact's single precision causes differences of up to
1e-3, 0.08 dB.
"""

import numpy as np
import torch
from jaxtyping import Complex, Complex64, Float, Float32, Int, Int16

from radarize.io.errors import InputError
from radarize.io.stopwatch import stage
from radarize.radar.config import RadarConfig
from radarize.signal.batch import Batch
from radarize.signal.maps import Axes, Maker

#: Bursts of a Doppler-azimuth map, and of the three kinds of range-azimuth maps.
BURSTS, BUFFERS = 3, (1, 3, 5)
#: Columns of range-azimuth maps, rad, ascending to the left.
BEARINGS = np.radians(np.arange(-44.0, 44.0))
#: Beams of Doppler-azimuth maps, rad, ascending to the left before mirroring; the size that maps are resized to.
BEAMS, DOPPLER_SIZE = np.radians(np.arange(-91.0, 91.0)), (60, 181)
#: Natural logarithms of power that are mapped to 0 and 1.
DOPPLER_LEVELS, RANGE_LEVELS = (10.0, 25.0), (0.0, 18.0)
#: Rate of the frames that networks read, Hz.
RATE = 15.0

#: Channels (in firing order: TX1, TX3, TX2 x RX) of the azimuth row, and of the pairs at two heights.
ROW, LOWER, UPPER = slice(0, 8), slice(2, 6), slice(8, 12)
DOPPLER = {
    "published_doppler_azimuth": "log power over closing speed and azimuth, all channels as one line",
    "published_doppler_elevation_aware": "log power over closing speed and azimuth near the horizon",
}
RANGE = {f"published_range_azimuth_{n}": f"log power over range and azimuth, {n} frames" for n in BUFFERS}
LEVEL = {f"published_elevation_aware_{n}": f"log power near the horizon, {n} frames" for n in BUFFERS}


class PublishedMaps(Maker):
    """Computes the artefact's maps of a radar configuration, 0...1.

    Raises:
        InputError: the radar does not have twelve virtual channels.
    """

    maps = DOPPLER | RANGE | LEVEL
    unit = "natural logarithm, 0...1"
    history = warmup = max(*BUFFERS, BURSTS) - 1

    def __init__(self, config: RadarConfig):
        if len(set(config.tx)) * len(config.rx) != 12:
            raise InputError(f"tx {config.tx} and rx {config.rx}: expected 12 channels for the published method")
        self.config = config
        # The vector is in the order TX1, TX2, TX3; the artefact applies it to the first, second, third chirp.
        self._calibration = self._tensor(config.calibration.reshape(12, 1))
        slow, (rows, columns) = BURSTS * config.loops, DOPPLER_SIZE
        self._rows = torch.as_tensor(area_weights(slow, rows), dtype=torch.float32)
        self._columns = torch.as_tensor(area_weights(len(BEAMS), columns), dtype=torch.float32)

    @staticmethod
    def stride(config: RadarConfig) -> int:
        """Return the interval of the frames that networks read, in frames: every second one at 30 Hz."""
        return max(1, round(1 / (RATE * config.frame_period)))

    @staticmethod
    def axes(config: RadarConfig, name: str) -> Axes:
        """Return the axes of a map; rows of Doppler-azimuth maps ascend with opening speed, columns to the right."""
        if name in DOPPLER:
            rows, columns = DOPPLER_SIZE
            places = (np.arange(columns) + 0.5) * len(BEAMS) / columns - 0.5
            azimuths = np.interp(places, np.arange(len(BEAMS)), BEAMS)[::-1]
            return Axes(rows, 2 * config.max_velocity / rows, azimuths, centred=True)
        return Axes(config.samples, config.range_resolution, BEARINGS)

    def __call__(
        self,
        adc: Int16[np.ndarray, "frame loop tx rx sample 2"],
        valid: object = None,
        names: tuple[str, ...] | None = None,
        frames: slice | Int[np.ndarray, "map"] = slice(None),
    ) -> dict[str, Float32[np.ndarray, "map row azimuth"]]:
        """Compute maps as described in `Maker`; frames before the first and lost samples are zero."""
        if tuple(adc.shape[1:]) != self.config.frame_shape:
            raise InputError(f"frames have shape {tuple(adc.shape[1:])}, expected {self.config.frame_shape}")
        names, channels, wanted = names or self.names, self.channels(adc), np.arange(len(adc))[frames]
        doppler, made = [n for n in names if n in DOPPLER], {}
        if doppler:
            silence = channels.new_zeros(BURSTS - 1, *channels.shape[1:])
            bursts = torch.cat([silence, channels]).unfold(0, BURSTS, 1)[wanted]  # (frame, loop, channel, sample, 3)
            slow = bursts.permute(0, 4, 1, 2, 3).flatten(1, 2)
            found = [self._doppler_azimuth(one) for one in slow]
            made = {name: torch.stack([pair[k] for pair in found]) for k, name in enumerate(DOPPLER) if name in names}
        if len(doppler) < len(names):
            made |= self._range_azimuth(channels, wanted)
        return {name: made[name].float().numpy() for name in names}

    def channels(
        self, adc: Int16[np.ndarray, "frame loop tx rx sample 2"]
    ) -> Complex64[torch.Tensor, "frame loop 12 sample"]:
        """Return calibrated samples of the virtual channels in firing order: 0-3 TX1, 4-7 TX3, 8-11 TX2."""
        samples = torch.view_as_complex(torch.as_tensor(adc).float())[:, :, list(self.config.turn)]
        return samples.flatten(2, 3) * self._calibration

    def _doppler_azimuth(self, slow: Complex64[torch.Tensor, "chirp 12 sample"]) -> tuple[torch.Tensor, torch.Tensor]:
        """Compute maps of all channels and of the elevation-aware array, by Bartlett's beamformer."""
        moving = torch.fft.fftshift(torch.fft.fft(slow - slow.mean(dim=0), dim=0), dim=0)
        moving = moving - moving.mean(dim=2, keepdim=True)
        level = (moving[:, LOWER] + moving[:, UPPER]) / 2
        maps = []
        for x in (moving, level):
            beams = self._steering(x.shape[1], BEAMS)
            covariance = x @ x.mH / x.shape[2]
            power = ((covariance @ beams) * beams.conj()).sum(dim=1).real
            maps.append((self._rows @ levels(power, DOPPLER_LEVELS) @ self._columns.T).flip(1))
        return maps[0], maps[1]

    def _range_azimuth(
        self, channels: Complex64[torch.Tensor, "frame loop 12 sample"], wanted: np.ndarray
    ) -> dict[str, torch.Tensor]:
        """Compute maps of the azimuth row and the elevation-aware array, by Capon's beamformer over 1, 3 and 5
        frames."""
        profiles = torch.fft.fft(channels, dim=3).to(torch.complex128).permute(0, 3, 2, 1)  # (frame, range, 12, loop)
        row, level = profiles[:, :, ROW], (profiles[:, :, LOWER] + profiles[:, :, UPPER]) / 2
        chirps = 2 * self.config.loops
        # With the other transmitter's channels zero, a chirp adds to its own block only.
        blocks = [row[:, :, :4], row[:, :, 4:]]
        separate = torch.stack([x @ x.mH / chirps for x in blocks], dim=2)  # (frame, range, block, 4, 4)
        whole = (level @ level.mH / chirps)[:, :, None]
        steering = self._steering(8, BEARINGS).to(torch.complex128)
        made = {}
        for names, covariance, beams in (
            (RANGE, separate, steering.reshape(2, 4, -1)),
            (LEVEL, whole, steering[:4].reshape(1, 4, -1)),
        ):
            silence = covariance.new_zeros(self.history, *covariance.shape[1:])
            buffer = torch.cat([silence, covariance])
            for name, count in zip(names, BUFFERS, strict=True):
                shifted = (buffer[wanted + self.history - k] for k in range(count))
                mean = sum(shifted, start=buffer.new_zeros(())) / count
                made[name] = levels(capon(mean, beams), RANGE_LEVELS).float()
        return made

    def _steering(self, antennas: int, azimuths: np.ndarray) -> torch.Tensor:
        """Return steering vectors (antenna, azimuth) of a line of antennas half a wavelength apart, to the left."""
        return self._tensor(np.exp(-1j * np.pi * np.arange(antennas)[:, None] * np.sin(azimuths)))

    def _tensor(self, values: np.ndarray) -> torch.Tensor:
        return torch.as_tensor(values).to(torch.complex64)


def capon(
    covariance: Complex[torch.Tensor, "*item block antenna antenna"],
    beams: Complex[torch.Tensor, "block antenna azimuth"],
) -> Float[torch.Tensor, "*item azimuth"]:
    """Compute Capon's power spectrum of an array with a block-diagonal covariance: 1 / sum over blocks of a^H R^-1
    a."""
    # 1e-6 squared counts: negligible compared with the ADC's rounding, and zero samples stay regular.
    regular = covariance + 1e-6 * torch.eye(covariance.shape[-1], dtype=covariance.dtype, device=covariance.device)
    form = ((torch.linalg.inv(regular) @ beams) * beams.conj()).sum(dim=(-3, -2)).real
    return 1 / form


class PublishedStream:
    """Maps of a stream of frames: every second frame at 30 Hz, from the first frame with full buffers on.

    Raises:
        InputError: see `PublishedMaps`.
    """

    def __init__(self, radar: RadarConfig):
        self._maker = PublishedMaps(radar)
        self._stride = self._maker.stride(radar)
        self._buffer: np.ndarray | None = None

    def maps(self, batch: Batch) -> tuple[Int[np.ndarray, "used"], dict[str, Float32[np.ndarray, "used row azimuth"]]]:
        """Return the indices of the next frames that are used, and their maps."""
        assert batch.samples is not None  # the methods do not read pictures
        before = 0 if self._buffer is None else len(self._buffer)
        frames = batch.samples if self._buffer is None else np.concatenate([self._buffer, batch.samples])
        self._buffer = frames[-self._maker.history :].copy()
        since = batch.numbers - self._maker.warmup
        used = np.flatnonzero((since >= 0) & (since % self._stride == 0))
        with stage("maps"):
            return used, self._maker(frames, frames=before + used) if len(used) else {}


def levels(power: torch.Tensor, span: tuple[float, float]) -> torch.Tensor:
    """Map the natural logarithm of power from a span to 0...1, and clip it."""
    low, high = span
    return ((power.clamp_min(1.0).log() - low) / (high - low)).clamp(0, 1)


def area_weights(size: int, target: int) -> Float[np.ndarray, "target size"]:
    """Return weights that resize an axis by area averaging: each new cell is the mean of the old ones it covers."""
    edges = np.arange(target + 1) * size / target
    cells = np.arange(size)
    shared = np.minimum(edges[1:, None], cells + 1) - np.maximum(edges[:-1, None], cells)
    return shared.clip(0) * target / size
