"""Heat maps as the published artefact makes them.

What the default maps do otherwise, and these on purpose do not:

- Channels are calibrated in the order in which chirps fire, so that TX2 and TX3 get each other's factors.
- What a moving target's phase turns from one TDM slot to the next stays in. There are no windows and no loading.
- Slow time is three bursts put end to end, as if there were no pauses between them.
- Doppler-azimuth takes all twelve channels for one line of antennas half a wavelength apart.
- Range-azimuth fills the channels that a chirp does not measure with zeros. Chirps of TX1 and TX3 then have no
  products in the covariance, which falls apart into two arrays of four antennas.

- Covariances are divided by twice the loops: a loop counts as two chirps, for the row of eight (which it is) and for
  the elevation-aware array of four (whose second chirp is all zeros).
- Doppler-azimuth maps are mirrored in both axes: rows ascend with the speed of *going away*, columns to the right.
- The first frames have no maps, until the longest buffer is full. The artefact begins with the third frame, and gives
  it and the fourth the five-frame maps of the fifth, which come nearest in time: a stream cannot see ahead.

Maps agree with those of the artefact's own code within 1e-4 (tests/baselines/test_published_golden.py), but for some of
100 cells in range bins with echoes 40 dB above the noise, where its single precision shows: up to 1e-3, 0.08 dB.
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
#: Natural logarithms of power that become 0 and 1.
DOPPLER_LEVELS, RANGE_LEVELS = (10.0, 25.0), (0.0, 18.0)
#: Frames a second that networks see.
RATE = 15.0

#: Channels (in firing order: TX1, TX3, TX2 x RX) of the row, and of the pairs that differ in height.
ROW, LOWER, UPPER = slice(0, 8), slice(2, 6), slice(8, 12)
DOPPLER = {
    "published_doppler_azimuth": "log power over closing speed and azimuth, all channels as one line",
    "published_doppler_elevation_aware": "log power over closing speed and azimuth near the horizon",
}
RANGE = {f"published_range_azimuth_{n}": f"log power over range and azimuth, {n} frames" for n in BUFFERS}
LEVEL = {f"published_elevation_aware_{n}": f"log power near the horizon, {n} frames" for n in BUFFERS}


class PublishedMaps(Maker):
    """Makes the artefact's maps of one radar configuration, 0...1.

    Raises:
        InputError: the radar has not twelve virtual channels.
    """

    maps = DOPPLER | RANGE | LEVEL
    unit = "natural logarithm, 0...1"
    history = warmup = max(*BUFFERS, BURSTS) - 1

    def __init__(self, config: RadarConfig):
        if len(set(config.tx)) * len(config.rx) != 12:
            raise InputError(f"tx {config.tx} and rx {config.rx} are no 12 channels, which the published method needs")
        self.config = config
        # The vector lists TX1, TX2, TX3; the artefact multiplies the first, second, third chirp with it.
        self._calibration = self._tensor(config.calibration.reshape(12, 1))
        slow, (rows, columns) = BURSTS * config.loops, DOPPLER_SIZE
        self._rows = torch.as_tensor(area_weights(slow, rows), dtype=torch.float32)
        self._columns = torch.as_tensor(area_weights(len(BEAMS), columns), dtype=torch.float32)

    @staticmethod
    def stride(config: RadarConfig) -> int:
        """Frames from one that networks see to the next: half of the frames, of 30 a second."""
        return max(1, round(1 / (RATE * config.frame_period)))

    @staticmethod
    def axes(config: RadarConfig, name: str) -> Axes:
        """Rows and columns of a map; of Doppler-azimuth maps, rows ascend with opening speed, columns to the right."""
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
        """See `Maker`: before the first frame there was nothing, and what was lost counts as silence."""
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
        """Calibrated samples of virtual channels in firing order: 0-3 are TX1's, 4-7 TX3's, 8-11 TX2's."""
        samples = torch.view_as_complex(torch.as_tensor(adc).float())[:, :, list(self.config.turn)]
        return samples.flatten(2, 3) * self._calibration

    def _doppler_azimuth(self, slow: Complex64[torch.Tensor, "chirp 12 sample"]) -> tuple[torch.Tensor, torch.Tensor]:
        """Maps of all channels and of the elevation-aware array, by Bartlett's beamformer."""
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
        """Maps of the row and of the elevation-aware array by Capon's beamformer, over one, three and five frames."""
        profiles = torch.fft.fft(channels, dim=3).to(torch.complex128).permute(0, 3, 2, 1)  # (frame, range, 12, loop)
        row, level = profiles[:, :, ROW], (profiles[:, :, LOWER] + profiles[:, :, UPPER]) / 2
        chirps = 2 * self.config.loops
        # With the other transmitter's channels zero, a chirp adds to its own block only.
        blocks = [row[:, :, :4], row[:, :, 4:]]
        apart = torch.stack([x @ x.mH / chirps for x in blocks], dim=2)  # (frame, range, block, 4, 4)
        whole = (level @ level.mH / chirps)[:, :, None]
        steering = self._steering(8, BEARINGS).to(torch.complex128)
        made = {}
        for names, covariance, beams in (
            (RANGE, apart, steering.reshape(2, 4, -1)),
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
        """Phasors (antenna, azimuth) of a line of antennas half a wavelength apart, numbered to the left."""
        return self._tensor(np.exp(-1j * np.pi * np.arange(antennas)[:, None] * np.sin(azimuths)))

    def _tensor(self, values: np.ndarray) -> torch.Tensor:
        return torch.as_tensor(values).to(torch.complex64)


def capon(
    covariance: Complex[torch.Tensor, "*item block antenna antenna"],
    beams: Complex[torch.Tensor, "block antenna azimuth"],
) -> Float[torch.Tensor, "*item azimuth"]:
    """Capon's power of an array whose covariance is made of blocks: 1 / sum of a^H R^-1 a over them."""
    # A millionth of a squared count: nothing beside an ADC's rounding, and silence stays regular.
    regular = covariance + 1e-6 * torch.eye(covariance.shape[-1], dtype=covariance.dtype, device=covariance.device)
    form = ((torch.linalg.inv(regular) @ beams) * beams.conj()).sum(dim=(-3, -2)).real
    return 1 / form


class PublishedStream:
    """Maps of a stream's frames, of 30 a second every second one, from the first on that has all of its buffers.

    Raises:
        InputError: see `PublishedMaps`.
    """

    def __init__(self, radar: RadarConfig):
        self._maker = PublishedMaps(radar)
        self._stride = self._maker.stride(radar)
        self._buffer: np.ndarray | None = None

    def maps(self, batch: Batch) -> tuple[Int[np.ndarray, "used"], dict[str, Float32[np.ndarray, "used row azimuth"]]]:
        """Which of the next frames are used, and their maps."""
        assert batch.samples is not None  # the methods are none of pictures
        before = 0 if self._buffer is None else len(self._buffer)
        frames = batch.samples if self._buffer is None else np.concatenate([self._buffer, batch.samples])
        self._buffer = frames[-self._maker.history :].copy()
        since = batch.numbers - self._maker.warmup
        used = np.flatnonzero((since >= 0) & (since % self._stride == 0))
        with stage("maps"):
            return used, self._maker(frames, frames=before + used) if len(used) else {}


def levels(power: torch.Tensor, span: tuple[float, float]) -> torch.Tensor:
    """Natural logarithm of power, with a span of it mapped to 0...1 and cut there."""
    low, high = span
    return ((power.clamp_min(1.0).log() - low) / (high - low)).clamp(0, 1)


def area_weights(size: int, target: int) -> Float[np.ndarray, "target size"]:
    """Weights that resize an axis by areas: each new cell is the mean of what it covers of the old ones."""
    edges = np.arange(target + 1) * size / target
    cells = np.arange(size)
    shared = np.minimum(edges[1:, None], cells + 1) - np.maximum(edges[:-1, None], cells)
    return shared.clip(0) * target / size
