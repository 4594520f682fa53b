"""Radar configuration: transmitted chirps, timing, antennas, and sampling."""

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import Complex, Float
from pydantic import ConfigDict, Field, ValidationError, ValidationInfo, field_validator, model_validator

from radarize.io.errors import InputError
from radarize.io.schema import Described
from radarize.radar.boards import BOARDS, SUFFIXES, Board, expected, load_board

SPEED_OF_LIGHT = 299_792_458.0

#: High-pass corner frequencies (Hz) that the codes 0-3 of a profile select (data sheet SWRS228).
HIGH_PASS_1 = (175e3, 235e3, 350e3, 700e3)
HIGH_PASS_2 = (350e3, 700e3, 1.4e6, 2.8e6)
#: Chirps of a loop.
_MOST_CHIRPS = 512
#: Largest size of a frame, bytes: the largest values of all limits below together are not realistic.
_LARGEST = 64 << 20
Factor = Annotated[float, Field(ge=-1e6, le=1e6)]
#: Transmitters of a chirp: a number, or the numbers of several that fire simultaneously.
Firing = int | tuple[int, ...]


def fired(firing: Firing) -> tuple[int, ...]:
    """Numbers of the transmitters that fire in a chirp."""
    return (firing,) if isinstance(firing, int) else firing


def firing_name(firing: Firing) -> str:
    """Transmitters of a chirp with their names on the board: ``TX1``, ``TX1 and TX3``."""
    return " and ".join(f"TX{transmitter + 1}" for transmitter in fired(firing))


def antennas(count: int) -> str:
    """Range of `count` antenna numbers, for error messages."""
    return ", ".join(map(str, range(count)))


def _receivers(fields: dict[str, Any]) -> tuple[int, ...]:
    """All receivers of the board."""
    return tuple(range(len(load_board(fields["board"]).rx))) if "board" in fields else ()


class RadarConfig(Described):
    """One TDM-MIMO chirp profile of a TI xWR radar.

    Times count from the start of a chirp's cycle: idle time first, then the ramp, in which the ADC samples from
    ``idle_time + adc_start_time`` on. All chirps of a frame use one profile; they differ in their transmitter only.

    Attributes:
        board: name in `radarize.radar.boards.BOARDS`, or the path of a board's file, whose content a recording keeps.
        start_frequency: carrier at the start of the ramp, Hz.
        slope: chirp slope, Hz/s.
        idle_time: idle time before the ramp, s.
        adc_start_time: start of sampling after the start of the ramp, s.
        ramp_end_time: end of the ramp after its start, s.
        samples: complex samples per chirp and receiver.
        sample_rate: complex sample rate (complex-1x), Hz.
        loops: repetitions of the transmitter sequence per frame.
        frame_period: time from the start of a frame to the start of the next, s.
        tx_order: transmitters in firing order, 0-based physical numbers (TX1 is 0). One that fires several times in a
            loop is listed as often, with its own index on the tx axis each time; several that fire simultaneously are
            listed as a tuple, and count as one transmitter midway between them.
        rx: enabled receivers, 0-based physical numbers, ascending; all of the board if not given.
        loop_idle_time: pause after a loop's last chirp, s (low-power chips: the rest of the burst period).
        bpm: slots, 0-based, of the two chirps in which two transmitters send in binary phase modulation: their sum in
            the first and their difference in the second. `radarize.radar.dca1000` separates them, so that samples are
            those of `tx_order`, one transmitter after the other. None: no binary phase modulation.
        rx_gain_db: receive gain, dB.
        tx_backoff_db: transmit power below maximum, dB.
        high_pass: corner frequencies of the two high-pass stages, Hz.
        iq_order: order within a DCA1000 group of four words: ``"iiqq"`` (mmWave Studio) or ``"qqii"`` (SDK demo); or
            ``"real"``: twice as many real samples at twice the rate, of which the complex ones are made.
        range_bias: bias that is subtracted from measured ranges, m (first field of ``compRangeBiasAndRxChanPhase``);
            default: the board's.
        channel_calibration: measured complex factor per *physical* (tx, rx) of the board as (re, im) pairs: TX1 x RX1,
            RX2, ..., then TX2, ... None, and factors that are all 1, as in TI's files before a calibration: the board's
            factors, measured or nominal (the signs of its antennas).
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    board: str | Board = "iwr1843boost"
    # Limits are those of any radar, so that all derived values are finite; `limits` has the chips'.
    start_frequency: float = Field(ge=1e9, le=1e12)
    slope: float = Field(ge=1e9, le=1e17)
    idle_time: float = Field(ge=1e-9, le=10)
    adc_start_time: float = Field(ge=0, le=10)
    ramp_end_time: float = Field(ge=1e-9, le=10)
    samples: int = Field(gt=0, le=1 << 14)
    sample_rate: float = Field(ge=1e3, le=1e12)
    loops: int = Field(gt=0, le=1 << 12)
    frame_period: float = Field(ge=1e-9, le=1e4)
    tx_order: tuple[Firing, ...] = Field(min_length=1, max_length=_MOST_CHIRPS)
    rx: tuple[int, ...] = Field(default_factory=_receivers, min_length=1)
    rx_gain_db: float = Field(30.0, ge=-1000, le=1000)
    tx_backoff_db: float = Field(0.0, ge=-1000, le=1000)
    high_pass: tuple[float, float] = (HIGH_PASS_1[0], HIGH_PASS_2[0])
    iq_order: Literal["iiqq", "qqii", "real"] = "qqii"
    range_bias: float = Field(0.0, ge=-1000, le=1000)
    channel_calibration: tuple[tuple[Factor, Factor], ...] | None = None
    # Only some radars' captures have these fields: other recordings do not store them.
    loop_idle_time: float = Field(0.0, ge=0, le=10, exclude_if=lambda value: value == 0)
    bpm: tuple[int, int] | None = Field(None, exclude_if=lambda value: value is None)

    @field_validator("board", mode="before")
    @classmethod
    def _read_board(cls, board: object, info: ValidationInfo) -> object:
        if not isinstance(board, str | Path) or str(board) in BOARDS:
            return board
        if info.mode == "json" or not str(board).endswith(SUFFIXES):  # a recording names no files
            raise ValueError(f"expected {expected()}")
        return load_board(board)

    @model_validator(mode="before")
    @classmethod
    def _bias_of_board(cls, fields: Any, info: ValidationInfo) -> Any:
        if not isinstance(fields, dict) or "range_bias" in fields or info.mode == "json":
            return fields
        try:
            return {**fields, "range_bias": load_board(fields["board"]).range_bias} if "board" in fields else fields
        except (InputError, TypeError):
            return fields  # the field's own validator reports the error

    @field_validator("channel_calibration")
    @classmethod
    def _measured(cls, pairs: tuple[tuple[float, float], ...] | None, info: ValidationInfo) -> object:
        if pairs is not None and set(pairs) == {(1.0, 0.0)}:
            return None
        return None if "board" in info.data and pairs == load_board(info.data["board"]).nominal_calibration else pairs

    @model_validator(mode="after")
    def _consistent(self) -> "RadarConfig":
        board = load_board(self.board)
        for name, count, numbers in (
            ("tx_order", len(board.tx), {t for firing in self.tx_order for t in fired(firing) or (-1,)}),
            ("rx", len(board.rx), set(self.rx)),
        ):
            if not numbers <= set(range(count)):
                raise ValueError(
                    f"{name} is {getattr(self, name)}, expected numbers of {antennas(count)} on the {board}"
                )
        if tuple(sorted(set(self.rx))) != self.rx:
            raise ValueError(f"rx is {self.rx}, expected ascending distinct numbers of {antennas(len(board.rx))}")
        channels = len(board.tx) * len(board.rx)
        if self.channel_calibration is not None and len(self.channel_calibration) != channels:
            raise ValueError(f"channel_calibration has {len(self.channel_calibration)} pairs, expected {channels}")
        if self.bpm is not None:
            slots = dict(enumerate(self.tx_order))
            first, second = (slots.get(slot) for slot in self.bpm)
            if not (isinstance(first, int) and isinstance(second, int) and first < second):
                raise ValueError(f"bpm is {self.bpm}, expected the slots of two transmitters, by ascending number")
        if self.frame_bytes > _LARGEST:
            raise ValueError(
                f"a frame of {self.loops} loops x {len(self.tx)} TX x {len(self.rx)} RX x {self.samples} samples has "
                f"{self.frame_bytes} bytes, expected at most {_LARGEST}"
            )
        if self.adc_start_time + self.samples / self.sample_rate > self.ramp_end_time * (1 + 1e-9):
            raise ValueError(
                f"the ADC window ends {1e6 * (self.adc_start_time + self.samples / self.sample_rate):.2f} us into the "
                f"ramp (adc_start_time + samples / sample_rate), expected no later than ramp_end_time = "
                f"{1e6 * self.ramp_end_time:.2f} us"
            )
        if self.burst_time > self.frame_period * (1 + 1e-9):
            raise ValueError(
                f"frame_period is {1e3 * self.frame_period:.3f} ms, expected at least the "
                f"{1e3 * self.burst_time:.3f} ms that {self.loops} loops x {len(self.tx_order)} chirps take"
            )
        return self

    @classmethod
    def build(cls, source: str, **fields: Any) -> "RadarConfig":
        """Build a configuration from its fields; `source` names their origin in error messages.

        Raises:
            InputError: a field is missing, unknown or out of range, or the fields contradict each other.
        """
        try:
            return cls(**fields)
        except ValidationError as error:
            first = min(error.errors(), key=lambda e: e["type"] == "missing")  # a wrong value is more informative
            field = ".".join(str(part) for part in first["loc"])
            message = first["msg"].removeprefix("Value error, ")
            if first["type"] == "missing":
                message = f"has no {field}"
            elif field:
                message = f"{field} is {first['input']!r}, {message[0].lower()}{message[1:]}"
            raise InputError(f"{source}: {message}") from error

    def changed(self, source: str, **fields: Any) -> "RadarConfig":
        """Change some fields of the configuration; `source` names their origin in error messages.

        A calibration applies to one board: a changed board brings its own unless one is given, and likewise its
        range bias.

        Raises:
            InputError: see `build`.
        """
        found = RadarConfig.build(source, **{**self.model_dump(), **fields})
        board, before = load_board(found.board), load_board(self.board)
        if board == before:
            return found
        measured: dict[str, Any] = {"channel_calibration": None}
        if board.calibration or before.calibration:
            measured["range_bias"] = board.range_bias
        return found.model_copy(update={name: each for name, each in measured.items() if name not in fields})

    # --- array -----------------------------------------------------------------------------------------------------
    @property
    def tx(self) -> tuple[Firing, ...]:
        """Enabled transmitters in physical order, the order of the tx axis of every decoded array."""
        return tuple(self.tx_order[slot] for slot in self.slot)

    @property
    def slot(self) -> tuple[int, ...]:
        """TDM slot (0 = fires first) of each transmitter of `tx`."""
        return tuple(sorted(range(len(self.tx_order)), key=lambda slot: fired(self.tx_order[slot])))

    @property
    def turn(self) -> tuple[int, ...]:
        """Index on the tx axis of the transmitter that fires in each slot: the inverse of `slot`."""
        return tuple(sorted(range(len(self.slot)), key=self.slot.__getitem__))

    @property
    def channels(self) -> tuple[np.ndarray, ...]:
        """Index of the enabled channels in an array of all the board's (tx, rx). Transmitters that fire simultaneously
        use the first one's: a factor common to all receivers changes no direction."""
        return np.ix_([fired(firing)[0] for firing in self.tx], self.rx)

    @property
    def frame_shape(self) -> tuple[int, int, int, int, int]:
        """Shape of one decoded frame: loop, tx, rx, sample, iq."""
        return self.loops, len(self.tx), len(self.rx), self.samples, 2

    @property
    def frame_bytes(self) -> int:
        """Bytes of one frame of int16 I/Q."""
        return 2 * int(np.prod(self.frame_shape))

    # --- range -----------------------------------------------------------------------------------------------------
    @property
    def bandwidth(self) -> float:
        """Bandwidth swept while sampling, Hz."""
        return self.slope * self.samples / self.sample_rate

    @property
    def center_frequency(self) -> float:
        """Carrier in the middle of the ADC window, Hz: where Doppler and angle are measured."""
        return self.start_frequency + self.slope * self.adc_center_time

    @property
    def wavelength(self) -> float:
        """Wavelength at `center_frequency`, m."""
        return SPEED_OF_LIGHT / self.center_frequency

    @property
    def range_resolution(self) -> float:
        """Spacing of range bins, m: c / 2B."""
        return SPEED_OF_LIGHT / (2 * self.bandwidth)

    @property
    def max_range(self) -> float:
        """Range at which the beat frequency reaches the sample rate, m."""
        return self.range_resolution * self.samples

    @property
    def ranges(self) -> Float[np.ndarray, "sample"]:
        """Range of each bin of a `samples`-point transform, m, without `range_bias`."""
        return self.range_resolution * np.arange(self.samples)

    # --- time and velocity -------------------------------------------------------------------------------------------
    @property
    def adc_center_time(self) -> float:
        """From the ramp's start to the middle of the samples (taken at adc_start_time + n / sample_rate), s."""
        return self.adc_start_time + (self.samples - 1) / (2 * self.sample_rate)

    @property
    def chirp_time(self) -> float:
        """One chirp cycle: idle plus ramp, s."""
        return self.idle_time + self.ramp_end_time

    @property
    def loop_time(self) -> float:
        """Repetition interval of one transmitter, s."""
        return self.chirp_time * len(self.tx_order) + self.loop_idle_time

    @property
    def chirps_per_loop(self) -> float:
        """Length of a loop in chirp cycles, its pause included."""
        return len(self.tx_order) + self.loop_idle_time / self.chirp_time

    @property
    def burst_time(self) -> float:
        """Active part of a frame, s."""
        return self.loop_time * self.loops

    @property
    def chirp_times(self) -> Float[np.ndarray, "loop tx"]:
        """Centre of each chirp's ADC window after the frame's time stamp, s, transmitters in physical order."""
        loops, slots = np.arange(self.loops)[:, None], np.asarray(self.slot)
        chirps = (loops * len(slots) + slots) * self.chirp_time + loops * self.loop_idle_time
        return chirps + self.idle_time + self.adc_center_time

    @property
    def burst_center(self) -> float:
        """Mean of `chirp_times`, s: the time to which single-frame products refer."""
        return float(self.chirp_times.mean())

    def every(self, count: int) -> "RadarConfig":
        """Configuration of a radar of which only every N-th frame is used.

        Raises:
            InputError: `count` is not positive.
        """
        if count < 1:
            raise InputError(f"every is {count}, expected 1 (all frames) or more")
        return self.model_copy(update={"frame_period": count * self.frame_period})

    @property
    def max_velocity(self) -> float:
        """Unambiguous radial speed, m/s: wavelength / (4 loop_time)."""
        return self.wavelength / (4 * self.loop_time)

    @property
    def velocity_resolution(self) -> float:
        """Radial speed per Doppler bin of one burst, m/s."""
        return self.wavelength / (2 * self.burst_time)

    @property
    def frame_rate(self) -> float:
        """Frames per second, Hz."""
        return 1 / self.frame_period

    def frames_within(self, duration: float) -> int:
        """Frames whose bursts end within `duration` (s)."""
        return max(int(np.floor((duration - self.burst_time) / self.frame_period)) + 1, 0)

    @property
    def calibration(self) -> np.ndarray:
        """Complex factor per enabled (tx, rx), to be multiplied onto decoded samples."""
        return self.channel_factors[self.channels]

    @property
    def channel_factors(self) -> Complex[np.ndarray, "tx rx"]:
        """The same for all (tx, rx) of the board: measured, or the board's."""
        board = load_board(self.board)
        pairs = self.channel_calibration or board.factors
        return np.array([complex(*pair) for pair in pairs]).reshape(len(board.tx), len(board.rx))
