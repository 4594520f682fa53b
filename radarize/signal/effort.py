"""Time and memory that a radar's frames take compared with those of the preset, for a remark before the work starts."""

from radarize.radar.config import RadarConfig
from radarize.radar.presets import PRESETS

#: Frames per batch: enough to vectorise, few enough to stay in cache.
BATCH = 16
#: Largest number of samples in a batch, and memory relative to them of all products (measured), bytes.
_MOST, _COPIES = 32 << 20, 27
#: Size of frames relative to the preset's from which there is a remark.
_WORTH = 2.0


def together(config: RadarConfig) -> int:
    """Frames per batch: fewer if they are large, so that memory is bounded."""
    return min(BATCH, max(_MOST // config.frame_bytes, 1))


def effort(config: RadarConfig, frames: int) -> str:
    """Remark on frames much larger than the preset's, or an empty text."""
    usual = PRESETS["radarize"].frame_bytes
    if config.frame_bytes < _WORTH * usual:
        return ""
    times, needed = config.frame_bytes / usual, _COPIES * together(config) * config.frame_bytes
    return (
        f"a frame has {times:.1f} times the samples of one of preset radarize: each of the {frames} takes up to that "
        f"many times as long (rotation at most 5 times), and a batch about {1e-6 * needed:.0f} MB of memory"
    )
