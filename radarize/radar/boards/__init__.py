"""Boards: antenna layout, chip and front end, each in a YAML file with the board's name.

The files in this folder are `BOARDS`; other boards are given by the path of their file wherever a board is named.
`iwr1843boost.yaml` documents the format. Antennas are numbered as on the board, TX1 and RX1 first; their number is that
in the file.
"""

import json
import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import Int
from pydantic import Field, ValidationError, field_validator, model_validator

from radarize.io.errors import InputError
from radarize.io.plain import Frozen, format_validation_error
from radarize.io.yamlfile import read_yaml
from radarize.radar.boards.chips import CHIPS

_FOLDER = Path(__file__).parent
SUFFIXES = (".yaml", ".yml")
Coordinate = Annotated[float, Field(ge=-1000, le=1000)]
Place = tuple[Coordinate, Coordinate]
Sign = Literal[-1, 1]
Part = Annotated[float, Field(ge=-1e6, le=1e6)]


class Mounting(Frozen):
    """Mounting of the sensor on its carrier; None: not observed.

    Attributes:
        height: height above the floor, m.
        lever_arm: distance ahead of the carrier's axle, m.
        yaw: yaw to the carrier's forward direction, positive to the left, rad.
        tilt: angle by which the front is raised, rad.
        lean: angle by which the left side is raised, rad.
    """

    height: float | None = None
    lever_arm: float | None = None
    yaw: float | None = None
    tilt: float | None = None
    lean: float | None = None


def _in_phase(antennas: tuple[Place, ...]) -> tuple[Sign, ...]:
    one: Sign = 1
    return tuple(one for _ in antennas)


class Board(Frozen):
    """Radar board.

    Attributes:
        name: name of the board's file without suffix.
        source: document that describes the layout.
        chip: name in `radarize.radar.boards.chips.CHIPS`, which has its bands and limits.
        design_frequency: frequency of the antenna spacings, Hz.
        tx: positions of the transmit antennas as (left, up) in half wavelengths at the design frequency.
        rx: positions of the receive antennas, likewise.
        tx_sign: -1 for a transmit antenna fed from the opposite side of the patch, which turns its phase by 180 deg.
            Default: 1 for all.
        rx_sign: the same for receive antennas.
        platforms: other names of this board in configurations (``% Platform:``, ``mmWaveDevice``).
        calibration: measured factor per physical (tx, rx) as (re, im) pairs, by which samples are multiplied, signs of
            the antennas included; None: not measured.
        range_bias: measured minus true range, m.
        mounting: mounting of the sensor on its carrier, not used in processing; None: not measured.
        front_end: fields of `radarsim.receiver.frontend_config.FrontEndConfig`, which only the simulator reads.
    """

    name: str
    source: str
    chip: str
    design_frequency: float = Field(ge=1e9, le=1e12)
    tx: tuple[Place, ...] = Field(min_length=1, max_length=16)
    rx: tuple[Place, ...] = Field(min_length=1, max_length=16)
    tx_sign: tuple[Sign, ...] = Field(default_factory=lambda fields: _in_phase(fields.get("tx", ())))
    rx_sign: tuple[Sign, ...] = Field(default_factory=lambda fields: _in_phase(fields.get("rx", ())))
    platforms: tuple[str, ...] = ()
    calibration: tuple[tuple[Part, Part], ...] | None = None
    range_bias: float = Field(0.0, ge=-1000, le=1000)
    mounting: Mounting | None = None
    front_end: dict[str, Any]

    @field_validator("chip")
    @classmethod
    def _known(cls, chip: str) -> str:
        if chip not in CHIPS:
            raise ValueError(f"one of {', '.join(CHIPS)}")
        return chip

    @model_validator(mode="after")
    def _as_many_signs(self) -> "Board":
        for name, antennas in (("tx_sign", self.tx), ("rx_sign", self.rx)):
            if len(signs := getattr(self, name)) != len(antennas):
                raise ValueError(f"{name} has {len(signs)} entries, expected one for each of {len(antennas)} antennas")
        channels = len(self.tx) * len(self.rx)
        if self.calibration is not None and len(self.calibration) != channels:
            raise ValueError(
                f"calibration has {len(self.calibration)} entries, expected one for each of {channels} channels"
            )
        return self

    @field_validator("front_end", mode="before")
    @classmethod
    def _as_json(cls, fields: object) -> object:
        """Restore values from a recording's JSON, in which keys are text."""
        try:
            return json.loads(json.dumps(fields, default=str))
        except TypeError as error:
            raise ValueError("names and numbers as keys") from error

    @property
    def signs(self) -> Int[np.ndarray, "tx rx"]:
        """Sign of each channel."""
        return np.outer(self.tx_sign, self.rx_sign)

    @property
    def nominal_calibration(self) -> tuple[tuple[float, float], ...]:
        """Factor per physical (tx, rx) as (re, im) pairs that removes the channels' signs."""
        return tuple((float(sign), 0.0) for sign in self.signs.ravel())

    @property
    def factors(self) -> tuple[tuple[float, float], ...]:
        """The measured factors, or the nominal ones."""
        return self.calibration or self.nominal_calibration

    def __str__(self) -> str:
        return self.name

    def __hash__(self) -> int:
        return hash((self.name, self.design_frequency, self.tx, self.rx, self.tx_sign, self.rx_sign))


class _Files(Mapping[str, Board]):
    """Boards of this folder by name, read on first use."""

    def __getitem__(self, name: str) -> Board:
        if name not in _names():
            raise KeyError(name)
        return _read(name)

    def __iter__(self) -> Iterator[str]:
        return iter(_names())

    def __len__(self) -> int:
        return len(_names())


@cache
def _names() -> tuple[str, ...]:
    return tuple(sorted(path.stem for path in _FOLDER.glob("*.yaml")))


BOARDS: Mapping[str, Board] = _Files()


def load_board(board: str | Path | Board) -> Board:
    """Return a board by name, by the path of its file, or as it is given.

    Raises:
        InputError: unknown board or missing file, or a field that is missing, unknown or impossible.
    """
    if isinstance(board, Board):
        return board
    if str(board) in BOARDS:
        return BOARDS[str(board)]
    if not str(board).endswith(SUFFIXES):
        raise InputError(f"board is {str(board)!r}, expected {expected()}")
    data = read_yaml(board)
    if not isinstance(data, dict):
        raise InputError(f"{board}: holds a {type(data).__name__}, expected a board's fields such as chip, tx and rx")
    try:
        return Board.model_validate({"name": Path(board).stem, **data})
    except ValidationError as error:
        raise InputError(f"{board}: {format_validation_error(error)}") from error


@cache
def _read(name: str) -> Board:
    return load_board(_FOLDER / f"{name}.yaml")  # a file that does not change


def expected() -> str:
    """Describe the accepted values of a board's name."""
    return f"one of {', '.join(BOARDS)}, or the path of a board's .yaml file"


def named_board(device: str) -> str | None:
    """Return the board of a device's or platform's name (``xWR18xx``, ``IWR6843AOP``); None if it is unknown or
    ambiguous: a plain ``iwr6843`` may be on the ISK, the ODS or the AOP."""
    word = _plain(device)
    found = (name for name, board in BOARDS.items() if word in map(_plain, (name, *board.platforms)))
    return next(found, None)


def likely_board(start_frequency: float) -> str:
    """Return the most common evaluation board of a band (Hz), used if no board is named."""
    return "iwr1843boost" if start_frequency > 70e9 else "iwr6843isk"


def _plain(name: str) -> str:
    return re.sub("[^a-z0-9]", "", name.lower())
