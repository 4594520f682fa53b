"""Check of a configuration against the limits of its radar chip, before simulation or use.

The chips' limits are `radarize.radar.boards.chips.CHIPS`; frame limits are those of the mmWaveLink ICD. Existing
recordings are not checked.
"""

from collections.abc import Iterator

from radarize.io.errors import InputError
from radarize.radar.boards import Board, load_board
from radarize.radar.boards.chips import CHIPS, Chip
from radarize.radar.config import RadarConfig

MIN_CHIRP = 15e-6
FRAME_PERIODS = (300e-6, 1.342)
MIN_BLANK = 300e-6
MAX_RF_DUTY, MAX_ACTIVE_DUTY = 0.50, 0.99
MAX_CHIRP_BUFFER = 16 << 10
_TOLERANCE = 1e-9
#: Hz; TI's own files sweep 4000.1 MHz, rounding the ramp to 0.01 us.
_SWEEP_TOLERANCE = 1e6


def check_limits(config: RadarConfig, demo: bool = False) -> None:
    """Raise InputError for a configuration beyond the chip's limits.

    Args:
        demo: for the SDK demo, which keeps a frame in memory; mmWave Studio streams larger ones.

    Raises:
        InputError: names the first field outside its limit, its value and the limit.
    """
    for message in _violations(config, demo):
        raise InputError(f"radar configuration: {message}")


def covers(board: Board, start_frequency: float) -> bool:
    """Whether a band of the board's chip contains the start frequency, Hz."""
    return _sweeps(CHIPS[board.chip], start_frequency, start_frequency)


def outside_band(config: RadarConfig) -> str:
    """Describe in one sentence that the board does not have the start frequency; empty if it has."""
    board = load_board(config.board)
    if covers(board, config.start_frequency):
        return ""
    return (
        f"chirps start at {config.start_frequency / 1e9:g} GHz, but the {board} has {_bands(CHIPS[board.chip])}, so "
        "positions of antennas may be wrong"
    )


def _sweeps(chip: Chip, start: float, end: float) -> bool:
    """Whether a band of a chip contains the frequencies from start to end, Hz."""
    slack = _SWEEP_TOLERANCE
    return any(low - slack <= start and end <= high + slack for low, high in chip.bands)


def _bands(chip: Chip) -> str:
    return " or ".join(f"{low / 1e9:g}-{high / 1e9:g} GHz" for low, high in chip.bands)


def _violations(config: RadarConfig, demo: bool) -> Iterator[str]:
    name = load_board(config.board).chip
    chip = CHIPS[name]
    start, sweep = config.start_frequency, config.slope * config.ramp_end_time
    slack = _SWEEP_TOLERANCE
    if not _sweeps(chip, start, start + sweep):
        yield (
            f"start_frequency, slope and ramp_end_time sweep {start / 1e9:.3f}-{(start + sweep) / 1e9:.3f} GHz, "
            f"expected wholly within {_bands(chip)} on the {name}"
        )
    if sweep > chip.max_sweep + slack:
        yield f"slope x ramp_end_time is {sweep / 1e9:.3f} GHz, expected at most {chip.max_sweep / 1e9:g} GHz"
    if config.slope > chip.max_slope * (1 + _TOLERANCE):
        yield f"slope is {config.slope / 1e12:g} MHz/us, expected at most {chip.max_slope / 1e12:g} MHz/us"
    slowest, fastest = chip.sample_rates
    if not slowest <= config.sample_rate <= fastest:
        kind = " of complex samples, which are made of twice as many real ones" if chip.real else ""
        yield (
            f"sample_rate is {config.sample_rate / 1e6:g} Msps, expected {slowest / 1e6:g}-{fastest / 1e6:g} Msps{kind}"
        )
    idle = next(idle for limit, idle in chip.idle if sweep <= limit + slack)
    if config.idle_time < idle * (1 - _TOLERANCE):
        yield (
            f"idle_time is {config.idle_time * 1e6:g} us, expected at least {idle * 1e6:g} us "
            f"for a sweep of {sweep / 1e9:.3f} GHz"
        )
    if config.chirp_time < MIN_CHIRP * (1 - _TOLERANCE):
        yield f"idle_time + ramp_end_time is {config.chirp_time * 1e6:g} us, expected at least {MIN_CHIRP * 1e6:g} us"
    if config.loops > chip.max_loops:
        yield f"loops is {config.loops}, expected 1-{chip.max_loops}"
    if not FRAME_PERIODS[0] <= config.frame_period <= FRAME_PERIODS[1]:
        yield f"frame_period is {config.frame_period * 1e3:g} ms, expected 0.3-1342 ms"
    blank = config.frame_period - config.burst_time
    if blank < MIN_BLANK * (1 - _TOLERANCE) or config.burst_time >= MAX_ACTIVE_DUTY * config.frame_period:
        yield (
            f"frame_period is {config.frame_period * 1e3:g} ms for {config.burst_time * 1e3:.3f} ms of chirps, "
            f"expected at least 0.3 ms more and less than {MAX_ACTIVE_DUTY:.0%} of it active"
        )
    duty = config.loops * len(config.tx_order) * config.ramp_end_time / config.frame_period
    if duty >= MAX_RF_DUTY:
        yield (
            f"loops x transmitters x ramp_end_time keeps the RF on for {duty:.1%} of frame_period, "
            f"expected less than {MAX_RF_DUTY:.0%}"
        )
    if demo and config.frame_bytes > chip.memory:
        yield (
            f"loops x transmitters x receivers x samples make a frame of {config.frame_bytes} bytes, "
            f"expected at most {chip.memory}"
        )
    if config.samples % 2:
        yield f"samples is {config.samples}, expected an even number: LVDS carries complex samples in pairs"
    chirp_bytes = 4 * len(config.rx) * config.samples
    if chirp_bytes > MAX_CHIRP_BUFFER:
        yield f"samples x receivers make a chirp of {chirp_bytes} bytes, expected at most {MAX_CHIRP_BUFFER}"
    transfer = 8 * chirp_bytes / chip.lvds_rate
    if transfer > config.chirp_time * (1 + _TOLERANCE):
        yield (
            f"a chirp of {config.samples} samples takes {transfer * 1e6:.2f} us over LVDS, "
            f"expected at most idle_time + ramp_end_time = {config.chirp_time * 1e6:.2f} us"
        )
