"""What the radar chips can do; checked before a configuration is simulated or sent to a sensor.

Data sheets SWRS228 (IWR1843) and SWRS219 (IWR6843); minimum idle times: TI application report SWRA553; frame limits:
mmWaveLink ICD; memory: SDK demo with its radar cube in 1 MiB of L3. Finished recordings are not checked: they exist.
"""

from collections.abc import Iterator

from radarize.io.errors import InputError
from radarize.radar.boards import load_board
from radarize.radar.config import RadarConfig

#: Bands that a sweep must stay within wholly, Hz.
BANDS = {"iwr1843": ((76e9, 78e9), (77e9, 81e9)), "iwr6843": ((60e9, 64e9),)}
MAX_SWEEP = 4e9
MAX_SLOPE = {"iwr1843": 100e12, "iwr6843": 250e12}
SAMPLE_RATES = (2e6, 12.5e6)
#: Shortest idle time (s) for sweeps up to (Hz): the synthesizer must settle.
MIN_IDLE = ((1e9, 2e-6), (2e9, 3.5e-6), (3e9, 5e-6), (float("inf"), 7e-6))
MIN_CHIRP = 15e-6
MAX_LOOPS = 255
FRAME_PERIODS = (300e-6, 1.342)
MIN_BLANK = 300e-6
MAX_RF_DUTY, MAX_ACTIVE_DUTY = 0.50, 0.99
MAX_CUBE = 1 << 20
MAX_CHIRP_BUFFER = 16 << 10
LVDS_RATE = 2 * 600e6
_TOLERANCE = 1e-9
#: Hz; TI's own files sweep 4000.1 MHz, rounding the ramp to 0.01 us.
_SWEEP_TOLERANCE = 1e6


def check_limits(config: RadarConfig, demo: bool = False) -> None:
    """Refuse what the chip cannot do.

    Args:
        demo: under the SDK demo, which keeps a frame in memory; mmWave Studio streams larger ones.

    Raises:
        InputError: naming the first field outside its limit, its value and the limit.
    """
    for message in _violations(config, MAX_CUBE if demo else float("inf")):
        raise InputError(f"radar configuration: {message}")


def _violations(config: RadarConfig, largest: float) -> Iterator[str]:
    chip = load_board(config.board).chip
    start, sweep = config.start_frequency, config.slope * config.ramp_end_time
    slack = _SWEEP_TOLERANCE
    if not any(low - slack <= start and start + sweep <= high + slack for low, high in BANDS[chip]):
        bands = " or ".join(f"{low / 1e9:g}-{high / 1e9:g} GHz" for low, high in BANDS[chip])
        yield (
            f"start_frequency, slope and ramp_end_time sweep {start / 1e9:.3f}-{(start + sweep) / 1e9:.3f} GHz, "
            f"expected wholly within {bands} on the {chip}"
        )
    if sweep > MAX_SWEEP + slack:
        yield f"slope x ramp_end_time is {sweep / 1e9:.3f} GHz, expected at most {MAX_SWEEP / 1e9:g} GHz"
    if config.slope > MAX_SLOPE[chip] * (1 + _TOLERANCE):
        yield f"slope is {config.slope / 1e12:g} MHz/us, expected at most {MAX_SLOPE[chip] / 1e12:g} MHz/us"
    if not SAMPLE_RATES[0] <= config.sample_rate <= SAMPLE_RATES[1]:
        yield f"sample_rate is {config.sample_rate / 1e6:g} Msps, expected 2-12.5 Msps"
    idle = next(idle for limit, idle in MIN_IDLE if sweep <= limit + slack)
    if config.idle_time < idle * (1 - _TOLERANCE):
        yield (
            f"idle_time is {config.idle_time * 1e6:g} us, expected at least {idle * 1e6:g} us "
            f"for a sweep of {sweep / 1e9:.3f} GHz"
        )
    if config.chirp_time < MIN_CHIRP * (1 - _TOLERANCE):
        yield f"idle_time + ramp_end_time is {config.chirp_time * 1e6:g} us, expected at least {MIN_CHIRP * 1e6:g} us"
    if config.loops > MAX_LOOPS:
        yield f"loops is {config.loops}, expected 1-{MAX_LOOPS}"
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
    if config.frame_bytes > largest:
        yield (
            f"loops x transmitters x receivers x samples make a frame of {config.frame_bytes} bytes, "
            f"expected at most {largest}"
        )
    if config.samples % 2:
        yield f"samples is {config.samples}, expected an even number: LVDS carries complex samples in pairs"
    chirp_bytes = 4 * len(config.rx) * config.samples
    if chirp_bytes > MAX_CHIRP_BUFFER:
        yield f"samples x receivers make a chirp of {chirp_bytes} bytes, expected at most {MAX_CHIRP_BUFFER}"
    transfer = 8 * chirp_bytes / LVDS_RATE
    if transfer > config.chirp_time * (1 + _TOLERANCE):
        yield (
            f"a chirp of {config.samples} samples takes {transfer * 1e6:.2f} us over LVDS, "
            f"expected at most idle_time + ramp_end_time = {config.chirp_time * 1e6:.2f} us"
        )
