"""A radar's chirps on another board."""

from pathlib import Path

from radarize.radar.boards import load_board
from radarize.radar.boards.chips import CHIPS
from radarize.radar.config import RadarConfig
from radarize.radar.presets import PRESETS


def radar(board: str | Path) -> RadarConfig:
    """The preset's chirps on a board with all its antennas."""
    found = load_board(board)
    start = 77e9 if CHIPS[found.chip].bands[0][0] > 70e9 else 60e9
    tx, rx = (tuple(range(len(antennas))) for antennas in (found.tx, found.rx))
    order = PRESETS["radarize"].tx_order if len(tx) == 3 else tx
    fields = {"board": board, "start_frequency": start, "tx_order": order, "rx": rx}
    return PRESETS["radarize"].changed("radar", **fields)


def resolves_elevation(config: RadarConfig) -> bool:
    """Whether a board's antennas are in more than one row."""
    board = load_board(config.board)
    return len({height for _, height in board.tx}) * len({height for _, height in board.rx}) > 1
