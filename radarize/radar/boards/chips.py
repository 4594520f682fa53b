"""Limits of the radar chips, for `radarize.radar.limits`.

Data sheets: SWRS228 (IWR1843), SWRS236 (AWR1843AOP), SWRS219 and SWRS237 (IWR6843), SWRS203 (AWR1642), SWRS211
(IWR1443), SWRS223 (AWR2243), SWRS273 (AWR2944), SWRS298 (IWRL6432), SWRS325 (AWRL6844). Shortest idle times: TI
application report SWRA553. Memory: TI's demos, which keep a frame on the chip (not listed, and not checked, for the
low-power ones). Chips with real samples only are listed by the complex ones made of them: half as many at half the
rate. For the IWR1443, AWR2243, AWR2944 and both low-power chips the numbers are the data sheets' as commonly quoted;
they were not compared with the sheets' tables.
"""

from dataclasses import dataclass

#: Shortest idle time (s) for sweeps up to (Hz): the synthesizer must settle.
_IDLE = ((1e9, 2e-6), (2e9, 3.5e-6), (3e9, 5e-6), (float("inf"), 7e-6))
_77 = ((76e9, 78e9), (77e9, 81e9))


@dataclass(frozen=True)
class Chip:
    """Limits of a chip.

    Attributes:
        bands: bands that contain the whole sweep, Hz.
        sample_rates: complex-1x, Hz.
        max_slope: Hz/s.
        max_sweep: Hz.
        real: whether its converters give real samples only.
        idle: shortest idle time (s) for sweeps up to (Hz).
        max_loops: maximum per frame.
        memory: bytes that TI's demo has for a frame on the chip.
        lvds_rate: rate to the DCA1000, bit/s.
    """

    bands: tuple[tuple[float, float], ...]
    sample_rates: tuple[float, float]
    max_slope: float = 100e12
    max_sweep: float = 4e9
    real: bool = False
    idle: tuple[tuple[float, float], ...] = _IDLE
    max_loops: int = 255
    memory: float = 1 << 20
    lvds_rate: float = 2 * 600e6


CHIPS: dict[str, Chip] = {
    "iwr1843": Chip(_77, (2e6, 12.5e6)),
    "iwr6843": Chip(((60e9, 64e9),), (2e6, 12.5e6), max_slope=250e12),
    "awr1642": Chip(_77, (2e6, 6.25e6), memory=768 << 10),
    "iwr1443": Chip(_77, (2e6, 18.75e6), memory=384 << 10, lvds_rate=4 * 600e6),
    # No memory for frames: samples are streamed to a host.
    "awr2243": Chip(
        ((76e9, 81e9),), (2e6, 22.5e6), 266e12, max_sweep=5e9, memory=float("inf"), lvds_rate=4 * 600e6
    ),
    "awr2944": Chip(((76e9, 81e9),), (1e6, 18.75e6), 250e12, max_sweep=5e9, real=True, memory=5 << 19),
    # Low power. TI's own configurations have 6 us of idle time for any sweep; the required time is not checked.
    "iwrl6432": Chip(
        ((57e9, 64e9),), (0.5e6, 6.25e6), 400e12, max_sweep=7e9, real=True, idle=((float("inf"), 0.0),),
        max_loops=4096, memory=float("inf"),
    ),
    "awrl6844": Chip(
        ((57e9, 64e9),), (0.5e6, 12.5e6), 400e12, max_sweep=7e9, real=True, idle=((float("inf"), 0.0),),
        max_loops=4096, memory=float("inf"),
    ),
}  # fmt: skip
