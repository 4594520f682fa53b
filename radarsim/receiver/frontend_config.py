"""Settings of the front end. Each board's file has its own (`radarize.radar.boards`); a front-end file overrides some.

Every effect can be switched off (`null`, `false`); `FrontEndConfig.ideal()` has none.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import yaml
from jaxtyping import Complex, Float
from pydantic import Field, ValidationError, model_validator

from radarize.io.errors import InputError
from radarize.io.plain import Frozen
from radarize.io.replacing import replacing
from radarize.io.yamlfile import changed, read_yaml
from radarize.radar.boards import Board, load_board
from radarize.radar.config import SPEED_OF_LIGHT
from radarsim.propagation.antenna import ISOTROPIC, Antenna
from radarsim.world.validation import format_validation_error


class Channel(Frozen):
    """A complex amplitude of one (tx, rx) channel.

    Attributes:
        gain_db: magnitude, dB.
        phase_deg: phase, degrees.
    """

    gain_db: float
    phase_deg: float

    @property
    def factor(self) -> complex:
        """Complex amplitude of the channel."""
        return 10 ** (self.gain_db / 20) * np.exp(1j * np.deg2rad(self.phase_deg))

    @classmethod
    def of(cls, factor: complex) -> "Channel":
        """Convert a complex amplitude, rounded for readers."""
        return cls(
            gain_db=round(20 * np.log10(max(abs(factor), 1e-20)), 3), phase_deg=round(np.rad2deg(np.angle(factor)), 2)
        )


class _PerChannel(Frozen):
    """A property of each channel.

    Attributes:
        channels: measured amplitudes in physical order: TX1 x RX1, RX2, ..., then TX2, ...
    """

    channels: tuple[Channel, ...] | None = None

    def measured(self, board: Board, source: str = "front end") -> Complex[np.ndarray, "tx rx"]:
        """`channels` as complex amplitudes; `source` names their origin in error messages.

        Raises:
            InputError: their number differs from the board's.
        """
        tx, rx = len(board.tx), len(board.rx)
        channels = self.channels or ()
        if len(channels) != tx * rx:
            raise InputError(
                f"{source}: channels has {len(channels)} entries, expected {tx * rx} on the {board}: TX1 x RX1..{rx}, "
                "then TX2, ..."
            )
        return np.array([c.factor for c in channels]).reshape(tx, rx)


class Mismatch(_PerChannel):
    """Gain and phase errors of the channels.

    A channel's factor is the product of its transmitter's and its receiver's, each drawn from the seed within half the
    bounds, as on a real board: all channels of a TX share its error.

    Attributes:
        gain_db: bound of a channel's gain error, dB (data sheet SWRS228: 0.5 dB over temperature).
        phase_deg: bound of a channel's phase error, degrees (data sheet SWRS228: 3 deg over temperature).
        channels: measured factors in physical order (TX1 x RX1..4, TX2, TX3), instead of drawn ones.
    """

    gain_db: float = Field(0.5, ge=0, le=20)
    phase_deg: float = Field(3.0, ge=0, le=180)


class Leakage(_PerChannel):
    """Leakage from TX to RX on the board: one static echo at almost zero range.

    The default lies within the results of `radarsim calibrate` on three public captures of two boards: -42, -47 and -49
        dB
    at 0.42, 0.36 and 0.69 ns.

    Attributes:
        level_db: received over transmitted power before the high-pass filter, dB; each channel has a random phase.
        delay: delay of the leakage, s.
        channels: measured amplitudes in physical order, instead of `level_db` and random phases.
    """

    level_db: float = Field(-42.0, ge=-150, le=0)
    delay: float = Field(0.4e-9, ge=0, le=20e-9)


class MountEcho(_PerChannel):
    """Static echo of the radar's own housing, radome or mount.

    It is a sum over several edges: in the echoes of public captures `radarsim calibrate` finds no plane wave, and
        channel
    levels that spread like those of independent complex normal amplitudes.

    Attributes:
        distance: distance of the echo, m.
        level_db: received over transmitted power before the high-pass filter, mean over boards and channels, dB.
        channels: measured amplitudes in physical order, instead of `level_db` and amplitudes drawn for the board.
    """

    distance: float = Field(gt=0, le=1)
    level_db: float = Field(ge=-150, le=0)

    @property
    def delay(self) -> float:
        """Round-trip delay, s."""
        return 2 * self.distance / SPEED_OF_LIGHT


class PhaseNoise(Frozen):
    """Single-sideband phase noise of the transmitted signal.

    Attributes:
        offset_hz: offsets of the mask from the carrier, Hz, ascending.
        dbc_hz: phase noise at the offsets, dBc/Hz, linear over the logarithm of the offset in between.
        lower_band_db: added below 77 GHz, dB.
    """

    offset_hz: tuple[float, ...]
    dbc_hz: tuple[float, ...]
    lower_band_db: float = 0.0

    @model_validator(mode="after")
    def _consistent(self) -> "PhaseNoise":
        f = self.offset_hz
        if not f or len(f) != len(self.dbc_hz) or f[0] <= 0 or np.any(np.diff(f) <= 0):
            raise ValueError(f"offset_hz is {list(f)}, expected positive, ascending, and one per dbc_hz")
        return self


class Band(Frozen):
    """The decimation filter's amplitude response over the beat frequency, as fractions of the sample rate.

    0 at `low`, 1 from 0 to `flat`, 0 from `high` on, straight in between. Noise of real captures falls by 2 to 9 dB in
    the last sixteenth of the band, and images of echoes beyond 5 % of the sample rate are 50 to 70 dB down. The
    simulator searches echoes up to the frequency `high`.

    Attributes:
        low: beat frequency of zero response, below zero, as a fraction of the sample rate.
        flat: end of the pass band.
        high: beat frequency from which the response is zero.
    """

    low: float = Field(-0.06, lt=0)
    flat: float = Field(0.9, gt=0)
    high: float = Field(1.05, gt=0)

    @model_validator(mode="after")
    def _consistent(self) -> "Band":
        if self.high <= self.flat:
            raise ValueError(f"high is {self.high}, expected above flat = {self.flat}")
        return self

    def response(self, x: Float[np.ndarray, "*n"] | float) -> Float[np.ndarray, "*n"] | float:
        """Amplitude response at beat frequencies as fractions of the sample rate."""
        return np.interp(x, [self.low, 0.0, self.flat, self.high], [0.0, 1.0, 1.0, 0.0])

    def noise(self, x: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Power of white noise sampled after the filter, relative to its power before: the sum over all aliases."""
        aliases = np.arange(np.floor(self.low) - 1, np.ceil(self.high) + 1)
        return np.sum(self.response(np.add.outer(aliases, x)) ** 2, axis=0)


class FrontEndConfig(Frozen):
    """Everything between the field at the antennas and the samples in the file.

    Attributes:
        antenna: pattern of each element; null: isotropic.
        tx_power_dbm: transmit power per transmitter without back-off, dBm.
        noise: simulate thermal noise.
        noise_figure_db: noise figure by receive gain (both dB). Between two gains and beyond them it follows Friis's
            formula: the noise factor is linear in 1 / gain.
        full_scale_dbm: power of a complex tone of 32767 counts after the receive gain, dBm. Not in the data sheet;
            5 dBm puts the noise floor at 10.6 counts in the `radarize` preset (14 counts at 4 to 5 Msps in real
            captures) and clips 1 dB below the in-band compression point (-24 dBm at 30 dB).
        adc_bits: resolution of the converter. 16: all bits of the file carry signal, as in real captures, where the
            decimation filter has averaged a faster converter. 12: steps of 16 counts.
        leakage: leakage from the transmitters to the receivers; null: none.
        mount: static echoes of the radar's housing and mount; null: none. The default is the middle of what
            `radarsim calibrate` finds in three public captures of two boards: -61, -69 and -75 dB at 0.14, 0.13 and
            0.25 m.
        mismatch: gain and phase errors of the channels; null: none.
        phase_noise: phase noise of the transmitted signal; null: none.
        if_bandwidth_hz: bandwidth of the IF amplifier, Hz; it limits the beat frequency where no decimation filter
            does.
        high_pass: apply the two first-order high-pass stages of the radar configuration.
        band: response of the decimation filter; null: flat up to `if_bandwidth_hz`, and echoes beyond the maximum
            range alias.
        image_rejection_db: image rejection of the I/Q mixer, dB (data sheet: 30 dB); null: no image. The image of beat
            frequency f is at -f, outside the band of complex-1x sampling, so that only images of near echoes are within
            `band`.
    """

    antenna: Antenna | None
    tx_power_dbm: float = Field(ge=-60, le=60)
    noise: bool = True
    noise_figure_db: dict[float, float] = Field(min_length=1)
    full_scale_dbm: float = Field(5.0, ge=-100, le=100)
    adc_bits: int = Field(16, ge=2, le=16)
    leakage: Leakage | None = Leakage()
    mount: tuple[MountEcho, ...] | None = (MountEcho(distance=0.13, level_db=-69.0),)
    mismatch: Mismatch | None = Mismatch()
    phase_noise: PhaseNoise | None
    if_bandwidth_hz: float = Field(ge=1e5, le=1e9)
    high_pass: bool = True
    band: Band | None = Band()
    image_rejection_db: float | None = Field(30.0, ge=0, le=120)

    @classmethod
    def of(cls, board: str | Board, **changes: object) -> "FrontEndConfig":
        """Return the front end of a board's file with changes; nested settings (`leakage={"delay": 1e-9}`) are merged.

        Raises:
            InputError: unknown or impossible value, in the file or the changes, with the field's name.
        """
        board = load_board(board)
        settings = cls.build(f"{board.name}.yaml: front_end", board.front_end)
        return cls.build("front end", changed(settings, changes)) if changes else settings

    @classmethod
    def ideal(cls, board: str | Board = "iwr1843boost", **changes: object) -> "FrontEndConfig":
        """Front end with a board's power and a 16-bit converter only, with `changes`."""
        off = {"noise": False, "leakage": None, "mount": None, "mismatch": None, "phase_noise": None}
        return cls.of(
            board, **{"high_pass": False, "antenna": None, "band": None, "image_rejection_db": None, **off, **changes}
        )

    @property
    def pattern(self) -> Antenna:
        """Antenna pattern, isotropic if it is switched off."""
        return self.antenna or ISOTROPIC

    def noise_factor(self, gain_db: float) -> float:
        """Noise factor (linear) at a receive gain in dB; at least 1."""
        gains = np.array(list(self.noise_figure_db))
        factors = 10 ** (np.array(list(self.noise_figure_db.values())) / 10)
        line = np.polyfit(10 ** (-gains / 10), factors, min(1, len(gains) - 1))
        return max(float(np.polyval(line, 10 ** (-gain_db / 10))), 1.0)

    @classmethod
    def load(cls, path: str | Path, board: str | Board) -> "FrontEndConfig":
        """Read a front-end file; missing settings are the board's.

        Raises:
            InputError: unreadable, malformed YAML, unknown or impossible value, with file and field.
        """
        data = read_yaml(path)
        if not isinstance(data, dict | None):
            raise InputError(f"{path}: holds {type(data).__name__}, expected keys such as tx_power_dbm and leakage")
        found = cls.build(str(path), changed(cls.of(board), data or {}))
        for part in (found.mismatch, found.leakage, *(found.mount or ())):
            if part and part.channels is not None:
                part.measured(load_board(board), str(path))
        return found

    @classmethod
    def build(cls, source: str, fields: dict[str, object]) -> "FrontEndConfig":
        """Build settings from fields; `source` names their origin in error messages.

        Raises:
            InputError: unknown or impossible value, with the field's name.
        """
        try:
            return cls.model_validate(fields)
        except ValidationError as error:
            raise InputError(f"{source}: {format_validation_error(error, fields)}") from error

    def save(self, path: Path, remarks: Sequence[str] = ()) -> None:
        """Write a front-end file, with remarks as comments on top."""
        text = "".join(f"# {remark}\n" for remark in remarks) + yaml.safe_dump(
            self.model_dump(mode="json"), sort_keys=False, default_flow_style=None, width=120
        )
        with replacing(path) as part:
            part.write_text(text, encoding="utf-8")
