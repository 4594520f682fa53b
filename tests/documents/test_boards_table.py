"""The table of boards in docs/howto/board.md has the content of the board files."""

from pathlib import Path

from radarize.radar.array import azimuth_row, elevation_pairs
from radarize.radar.boards import BOARDS
from radarize.radar.boards.chips import CHIPS
from tests.radars import radar

PAGE = Path(__file__).resolve().parents[2] / "docs" / "howto" / "board.md"


def line(name: str) -> str:
    """A board's line of the table."""
    board, config = BOARDS[name], radar(name)
    chip = CHIPS[board.chip]
    band = f"{min(low for low, _ in chip.bands) / 1e9:g}-{max(high for _, high in chip.bands) / 1e9:g} GHz"
    elevation = "yes" if elevation_pairs(config) is not None else "no"
    samples = "real" if chip.real else "complex"
    platforms = ", ".join(board.platforms[:3])
    antennas = f"{len(board.tx)} x {len(board.rx)} | {len(azimuth_row(config))}"
    return f"| `{name}` | {band} | {antennas} | {elevation} | {samples} | {platforms} |"


def test_the_table_is_of_the_files():
    lines = [text for text in PAGE.read_text().splitlines() if text.startswith("| `") and text.count("|") == 8]
    assert lines == [line(name) for name in BOARDS]
