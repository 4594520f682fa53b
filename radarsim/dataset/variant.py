"""Variants of a recording: changes of radar, front end or scene level with the same walk, scatterers and noise."""

from collections.abc import Callable
from typing import Annotated

from pydantic import Field, field_validator

from radarize.io.plain import Frozen
from radarize.io.schema import Changes
from radarize.io.yamlfile import changed
from radarize.radar.boards import BOARDS, Board, load_board
from radarize.radar.config import RadarConfig
from radarize.radar.presets import PRESETS, load_config
from radarsim.motion.trajectory import Mounting
from radarsim.receiver.frontend_config import FrontEndConfig

Attributes = dict[str, str | float | int | bool]


class Variant(Frozen):
    """Changes of a recording against the specification.

    Attributes:
        level: level of the scene (`radarsim.world.description`); the trajectory is planned in its level 0.
        radar: fields of `RadarConfig` to change, or a preset in place of the radar.
        frontend: fields of `FrontEndConfig` to change; of its parts, those given.
        mounting: mounting of the sensor on the platform: x y z in m, roll pitch yaw in degrees.
        attributes: attributes of the files.
    """

    level: int = Field(0, ge=0)
    radar: Annotated[dict[str, object] | str, Changes(RadarConfig, tuple(PRESETS))] = {}
    frontend: Annotated[dict[str, object], Changes(FrontEndConfig)] = {}
    mounting: Annotated[tuple[float, ...], Field(min_length=6, max_length=6)] | None = None
    attributes: Attributes = {}

    @field_validator("radar")
    @classmethod
    def _known(cls, fields: dict | str) -> dict | str:
        if isinstance(fields, str):
            if fields not in PRESETS:
                raise ValueError(f"no such preset, expected one of {', '.join(PRESETS)}, or fields to change")
        elif unknown := fields.keys() - RadarConfig.model_fields:
            raise ValueError(f"{min(unknown)}: unknown key, expected some of {', '.join(RadarConfig.model_fields)}")
        return fields

    def with_board(self, beside: Callable[[str], str]) -> "Variant":
        """Return the variant with the name of a board replaced by the contents of its file, whose path `beside` gives.

        Raises:
            InputError: the file does not exist or cannot be used.
        """
        radar = self.radar if isinstance(self.radar, dict) else {}
        board = radar.get("board")
        if not isinstance(board, str) or board in BOARDS:
            return self
        return self.model_copy(update={"radar": {**radar, "board": load_board(beside(board))}})

    def radar_of(self, name: str) -> str | RadarConfig:
        """Return the radar of that name (preset or file) with the changes; the name itself if there are none.

        Raises:
            InputError: unknown preset, missing file, or impossible value.
        """
        if isinstance(self.radar, str):
            return self.radar
        return load_config(name)[0].changed("radar", **self.radar) if self.radar else name

    def frontend_of(self, file: str | None, board: str | Board) -> FrontEndConfig:
        """Return the front end of a file, or the board's, with the changes.

        Raises:
            InputError: unreadable file, or an unknown or impossible value.
        """
        settings = FrontEndConfig.load(file, board) if file else FrontEndConfig.of(board)
        return FrontEndConfig.build("frontend", changed(settings, self.frontend))

    @property
    def mounted(self) -> Mounting | None:
        """Mounting of the sensor; None: the platform's own."""
        return Mounting.of(self.mounting[:3], self.mounting[3:]) if self.mounting else None
