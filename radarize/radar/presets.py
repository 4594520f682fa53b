"""Radar configurations by name."""

from radarize.radar.config import RadarConfig

PRESETS: dict[str, RadarConfig] = {
    # The paper's `1843_v1`: 4 GHz, 30 frames/s, 1.89 m/s, 4.28 m.
    "radarize": RadarConfig(
        start_frequency=77e9,
        slope=80e12,
        idle_time=122e-6,
        adc_start_time=7e-6,
        ramp_end_time=50e-6,
        samples=96,
        sample_rate=2.285e6,
        loops=32,
        frame_period=33.333e-3,
        tx_order=(0, 2, 1),
    ),
    # Five times the range at the same frame rate and velocity span, for halls: 8 cm bins, 20 m.
    "long-range": RadarConfig(
        start_frequency=77e9,
        slope=35e12,
        idle_time=108e-6,
        adc_start_time=7e-6,
        ramp_end_time=64e-6,
        samples=256,
        sample_rate=4.8e6,
        loops=32,
        frame_period=33.333e-3,
        tx_order=(0, 2, 1),
    ),
    # Azimuth only, twice the unambiguous speed: TX1 and TX3.
    "two-tx": RadarConfig(
        start_frequency=77e9,
        slope=80e12,
        idle_time=36e-6,
        adc_start_time=7e-6,
        ramp_end_time=50e-6,
        samples=96,
        sample_rate=2.285e6,
        loops=64,
        frame_period=33.333e-3,
        tx_order=(0, 2),
    ),
}
