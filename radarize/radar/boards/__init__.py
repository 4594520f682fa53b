"""Boards: the antenna layout, the chip and the front end of each, in a YAML file of the board's name.

The files in this folder are `BOARDS`; a file elsewhere is given by its path wherever a board is named. The head of
`iwr1843boost.yaml` says what such a file holds. Antennas are numbered as on the board: TX1 to TX3, RX1 to RX4.
"""

import json
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, field_validator

from radarize.io.errors import InputError
from radarize.io.plain import Frozen, complaint
from radarize.io.yamlfile import read_yaml

_FOLDER = Path(__file__).parent
SUFFIXES = (".yaml", ".yml")
Coordinate = Annotated[float, Field(ge=-1000, le=1000)]
Place = tuple[Coordinate, Coordinate]
Sign = Literal[-1, 1]
Part = Annotated[float, Field(ge=-1e6, le=1e6)]


class Mounting(Frozen):
    """Where the sensor sits on its carrier, each value as far as a walk showed it, else None.

    Attributes:
        height: over the floor, m.
        lever_arm: ahead of the carrier's axle, m.
        yaw: of the sensor to the carrier's way ahead, rad, positive to the left.
        tilt: by how much the front is raised, rad.
        lean: by how much the left side is raised, rad.
    """

    height: float | None = None
    lever_arm: float | None = None
    yaw: float | None = None
    tilt: float | None = None
    lean: float | None = None


class Board(Frozen):
    """A board.

    Attributes:
        name: of its file, without the suffix.
        source: the document that describes the layout.
        chip: whose bands and limits apply.
        design_frequency: of the antenna spacings, Hz.
        tx, rx: antenna positions as (left, up) in half wavelengths at the design frequency.
        rx_sign: -1 for receivers fed from the opposite side of the patch, whose signal is turned by 180 deg.
        calibration: measured factor per physical (tx, rx) as (re, im) pairs, to be multiplied onto samples, signs of
            the receivers included; None: not measured.
        range_bias: m, measured ranges less the true ones.
        mounting: of the sensor; None: not measured. For the reader: nothing is computed from it.
        front_end: fields of `radarsim.receiver.frontend_config.FrontEndConfig`, which only the simulator reads.
    """

    name: str
    source: str
    chip: Literal["iwr1843", "iwr6843"]
    design_frequency: float = Field(ge=1e9, le=1e12)
    tx: tuple[Place, Place, Place]
    rx: tuple[Place, Place, Place, Place]
    rx_sign: tuple[Sign, Sign, Sign, Sign] = (1, 1, 1, 1)
    calibration: tuple[tuple[Part, Part], ...] | None = Field(None, min_length=12, max_length=12)
    range_bias: float = Field(0.0, ge=-1000, le=1000)
    mounting: Mounting | None = None
    front_end: dict[str, Any]

    @field_validator("front_end", mode="before")
    @classmethod
    def _as_json(cls, fields: object) -> object:
        """As it comes back from a recording's JSON: keys are text, and whatever is no plain data is."""
        try:
            return json.loads(json.dumps(fields, default=str))
        except TypeError as error:
            raise ValueError("names and numbers as keys") from error

    @property
    def nominal_calibration(self) -> tuple[tuple[float, float], ...]:
        """Factor per physical (tx, rx) as (re, im) pairs that takes the receivers' signs off again."""
        return tuple((float(sign), 0.0) for sign in self.rx_sign) * 3

    @property
    def factors(self) -> tuple[tuple[float, float], ...]:
        """The measured factors, or the nominal ones."""
        return self.calibration or self.nominal_calibration

    def __str__(self) -> str:
        return self.name

    def __hash__(self) -> int:
        return hash((self.name, self.design_frequency, self.tx, self.rx, self.rx_sign))


class _Files(Mapping[str, Board]):
    """The boards of this folder by name, read when asked for."""

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
    """A board by name, by the path of its file, or as it is given.

    Raises:
        InputError: no such board or file, or a field that is missing, unknown or impossible.
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
        raise InputError(f"{board}: {complaint(error)}") from error


@cache
def _read(name: str) -> Board:
    return load_board(_FOLDER / f"{name}.yaml")  # a file that nobody changes


def expected() -> str:
    """What may stand where a board is named."""
    return f"one of {', '.join(BOARDS)}, or the path of a board's .yaml file"


def board_of(device: str, start_frequency: float) -> str:
    """The evaluation board of a device name and band (Hz); plain iwr6843 is taken for the ISK, the commonest of its
    three boards."""
    if start_frequency > 70e9:
        return "iwr1843boost"
    name = device.lower()
    return "iwr6843aop" if "aop" in name else "iwr6843ods" if "ods" in name else "iwr6843isk"
