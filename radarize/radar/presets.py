"""Radar configurations by name: presets, or files."""

from pathlib import Path

from radarize.io.errors import InputError
from radarize.radar.cfg import parse_cfg, read_text, write_cfg
from radarize.radar.config import RadarConfig
from radarize.radar.studio import load_studio

PRESETS: dict[str, RadarConfig] = {
    # The paper's `1843_v1`: 4 GHz, 30 frames/s, 1.89 m/s, 4.28 m.
    "radarize": RadarConfig(
        start_frequency=77e9, slope=80e12, idle_time=122e-6, adc_start_time=7e-6, ramp_end_time=50e-6, samples=96,
        sample_rate=2.285e6, loops=32, frame_period=33.333e-3, tx_order=(0, 2, 1),
    ),
    # Five times the range at the same frame rate and velocity span, for halls: 8 cm bins, 20 m.
    "long-range": RadarConfig(
        start_frequency=77e9, slope=35e12, idle_time=108e-6, adc_start_time=7e-6, ramp_end_time=64e-6, samples=256,
        sample_rate=4.8e6, loops=32, frame_period=33.333e-3, tx_order=(0, 2, 1),
    ),
    # Azimuth only, twice the unambiguous speed: TX1 and TX3.
    "two-tx": RadarConfig(
        start_frequency=77e9, slope=80e12, idle_time=36e-6, adc_start_time=7e-6, ramp_end_time=50e-6, samples=96,
        sample_rate=2.285e6, loops=64, frame_period=33.333e-3, tx_order=(0, 2),
    ),
    # RadarHD's (Prabhakara et al., ICRA 2023): its data set's pictures take one loop of it, 4.2 cm bins up to 10.8 m.
    "radarhd": RadarConfig(
        start_frequency=77e9, slope=63.343e12, idle_time=10e-6, adc_start_time=6e-6, ramp_end_time=63.14e-6,
        samples=512, sample_rate=9.121e6, loops=64, frame_period=50e-3, tx_order=(0, 1, 2), rx_gain_db=30,
    ),
}  # fmt: skip


def load_config(source: str | Path | RadarConfig) -> tuple[RadarConfig, str]:
    """Load a configuration by preset name, or from a ``.cfg`` or ``.mmwave.json`` file, or return one as it is.

    Returns the configuration and the text it was read from (``write_cfg`` of it if there is none).

    Raises:
        InputError: unknown preset or missing file, or unusable content.
    """
    if not isinstance(source, RadarConfig):
        source = PRESETS.get(str(source), source)
    if isinstance(source, RadarConfig):
        return source, write_cfg(source)
    path = Path(source)
    if not path.is_file():
        raise InputError(
            f"{source}: no such radar configuration, expected a .cfg or .mmwave.json file or one of the presets "
            f"{', '.join(PRESETS)}"
        )
    if path.suffix.lower() == ".json":
        return load_studio(path)
    text = read_text(path)
    return parse_cfg(text, name=str(path)), text
