"""Settings from the user, for captures that do not contain all of them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from radarize.io.errors import InputError
from radarize.radar.boards import likely_board, load_board
from radarize.radar.config import RadarConfig

#: Settings that are needed to separate the frames.
REQUIRED = ("samples", "loops", "rx")

_START_FREQUENCY = 77e9
#: Values assumed if neither a configuration nor the user gives them: a common IWR1843 profile. They do not change the
#: samples, only the scales of range, velocity and time.
ASSUMED: dict[str, object] = {
    "tx_order": (0,),
    "iq_order": "qqii",  # unless the samples show another order
    "start_frequency": _START_FREQUENCY,
    "slope": 60e12,
    "sample_rate": 5e6,
    "idle_time": 10e-6,
    "adc_start_time": 6e-6,
}
#: s, ramp time after the last sample; minimum frame period, or 1.5 bursts if longer.
AFTER_ADC = 1e-6
_FRAME_PERIOD = 0.1


@dataclass(frozen=True)
class Given:
    """Settings of a capture from the user, which complete or replace those in the capture.

    config: radar configuration; by default the one beside the source.
    cfg_text: text of `config`, stored in the recording.
    overrides: fields of `RadarConfig` that replace or complete the configuration's; ``rx`` and ``tx`` may be
        counts; None means not given.
    start_time: stamp of the first frame, s.
    poses: TUM file of true poses of the sensor on the recording's clock.
    shape: axes of an array: names in order, such as ``frame,loop,tx,rx,sample``, or five or six lengths.
    variable: name of the array in an ``.npz`` or ``.mat``.
    latency: time from a frame's start to its receipt in a ROS bag, s; by default from headers, else the burst
        duration.
    imu_turn: roll, pitch, yaw of a ROS bag's IMU relative to the radar, degrees; by default from the name of its
        frame.
    walk: number of a walk in a data set of images.
    align: match frames of a walk with lidar images by time stamp instead of by frame index.
    encoding: encoding of .bin words, ``signed`` or ``offset-binary``.
    capture: number of one of several captures in a network capture, from 1.
    layout: order of .bin words, see `radarize.io.importers.layout`.
    """

    config: RadarConfig | None = None
    cfg_text: str = ""
    overrides: Mapping[str, object] = field(default_factory=dict)
    start_time: float | None = None
    poses: Path | None = None
    shape: str | None = None
    variable: str | None = None
    latency: float | None = None
    walk: int | None = None
    capture: int | None = None
    align: bool = False
    encoding: str = "signed"
    layout: str = "pairs"
    imu_turn: tuple[float, float, float] | None = None

    def or_else(self, config: RadarConfig, cfg_text: str) -> "Given":
        """Return the settings with a configuration and its text, unless they have one."""
        return self if self.config else replace(self, config=config, cfg_text=cfg_text)

    def configure(self, name: str, found: Mapping[str, object] | None = None) -> tuple[RadarConfig, tuple[str, ...]]:
        """Return the configuration with the overrides, and the names of assumed settings.

        Args:
            name: name of the capture in errors.
            found: settings in the source itself, used without a configuration.

        Raises:
            InputError: a value is impossible, or required ones are missing.
        """
        given: dict[str, Any] = {key: value for key, value in self.overrides.items() if value is not None}
        if self.config is None:
            given = {**(found or {}), **given}
        frequency = given.get("start_frequency")
        likely = likely_board(frequency if isinstance(frequency, float) else _START_FREQUENCY)
        board = load_board(given.get("board") or (self.config.board if self.config else likely))
        for key, most in (("rx", len(board.rx)), ("tx", len(board.tx))):
            if isinstance(count := given.get(key), int) and not 1 <= count <= most:
                raise InputError(f"{name}: {key} is {count}, expected 1 to {most} antennas")
        if isinstance(rx := given.get("rx"), int):
            given["rx"] = tuple(range(rx))
        if (tx := given.pop("tx", None)) is not None:
            given.setdefault("tx_order", tuple(range(tx)) if isinstance(tx, int) else tuple(tx))
        if self.config is not None:
            return (self.config.changed(name, **given) if given else self.config), ()

        if missing := [key for key in REQUIRED if key not in given]:
            raise InputError(
                f"{name}: has no radar configuration, expected a .cfg or .mmwave.json file, or at least values for "
                f"{', '.join(REQUIRED)} (missing: {', '.join(missing)})"
            )
        fields: dict[str, Any] = {"board": board.name, **ASSUMED, **given}
        try:
            adc_end = fields["adc_start_time"] + fields["samples"] / fields["sample_rate"]
            fields.setdefault("ramp_end_time", adc_end + AFTER_ADC)
            burst = fields["loops"] * len(fields["tx_order"]) * (fields["idle_time"] + fields["ramp_end_time"])
            fields.setdefault("frame_period", max(_FRAME_PERIOD, 1.5 * burst))
        except (TypeError, ZeroDivisionError, OverflowError):
            pass  # the checks of `RadarConfig` name the field
        return RadarConfig.build(name, **fields), tuple(key for key in fields if key not in given and key != "board")
