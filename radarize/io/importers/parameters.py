"""Settings given by hand, for captures that say too little of themselves."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from radarize.io.errors import InputError
from radarize.radar.boards import likely_board, load_board
from radarize.radar.config import RadarConfig

#: Without these nobody can tell the frames apart.
REQUIRED = ("samples", "loops", "rx")

_START_FREQUENCY = 77e9
#: Stand-ins where neither a configuration nor the user says otherwise: a common IWR1843 profile. They do not change
#: the samples, only the scales of range, velocity and time.
ASSUMED: dict[str, object] = {
    "tx_order": (0,),
    "iq_order": "qqii",  # unless the samples say otherwise
    "start_frequency": _START_FREQUENCY,
    "slope": 60e12,
    "sample_rate": 5e6,
    "idle_time": 10e-6,
    "adc_start_time": 6e-6,
}
#: s: the ramp goes on for a moment after the last sample; frames come ten a second, or with half their burst to spare.
AFTER_ADC = 1e-6
_FRAME_PERIOD = 0.1


@dataclass(frozen=True)
class Given:
    """What the user says of a capture, where it does not say so itself, or wrongly.

    Attributes:
        config: radar configuration; by default what lies beside the source.
        cfg_text: text that `config` was read from, kept in the recording.
        overrides: fields of `RadarConfig` that replace or stand in for the configuration's; ``rx`` and ``tx`` may be
            counts; None counts as not given.
        start_time: the first frame's stamp, s.
        poses: TUM file of the sensor's true poses on the recording's clock.
        shape: axes of an array: names in order, such as ``frame,loop,tx,rx,sample``, or five or six lengths.
        variable: which array of an ``.npz`` or ``.mat``.
        latency: from a frame's start to its receipt in a ROS bag, s; by default what the headers say, else the burst's
            length.
        imu_turn: roll, pitch, yaw of a ROS bag's IMU on the radar, degrees; by default what its frame's name says.
        walk: number of a walk in a data set of pictures.
        align: take, as truth of a walk's frame, the lidar's picture of the same instant, not of the same number.
        encoding: of a .bin's words, ``signed`` or ``offset-binary``.
        capture: which of several captures in a network capture, from 1.
        layout: of a .bin's words, see `radarize.io.importers.layout`.
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
        """The same with a configuration, and its text, unless there is one."""
        return self if self.config else replace(self, config=config, cfg_text=cfg_text)

    def configure(self, name: str, found: Mapping[str, object] | None = None) -> tuple[RadarConfig, tuple[str, ...]]:
        """The configuration with the overrides, and the names of settings that had to be assumed.

        Args:
            name: what errors call it.
            found: what the source itself says where there is no configuration.

        Raises:
            InputError: a value is impossible, or too few are known.
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
            pass  # the configuration's own checks name the field
        return RadarConfig.build(name, **fields), tuple(key for key in fields if key not in given and key != "board")
