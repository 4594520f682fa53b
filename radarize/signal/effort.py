"""What the frames of a radar cost, beside those of the preset: said before the work starts."""

from radarize.radar.config import RadarConfig
from radarize.radar.presets import PRESETS

#: Frames a batch: enough to vectorise over, few enough to stay in cache.
BATCH = 16
#: Samples that a batch may hold, and how often as much all that is made of them takes (measured), bytes.
_MOST, _COPIES = 32 << 20, 27
#: Frames so many times as large are worth a word.
_WORTH = 2.0


def together(config: RadarConfig) -> int:
    """Frames in a batch: fewer of large ones, so that memory is bounded."""
    return min(BATCH, max(_MOST // config.frame_bytes, 1))


def effort(config: RadarConfig, frames: int) -> str:
    """A sentence on frames much larger than the preset's, or nothing."""
    usual = PRESETS["radarize"].frame_bytes
    if config.frame_bytes < _WORTH * usual:
        return ""
    times, needed = config.frame_bytes / usual, _COPIES * together(config) * config.frame_bytes
    return (
        f"a frame holds {times:.1f} times the samples of one of preset radarize: each of the {frames} takes up to so "
        f"many times as long (rotation at most 5 times), and a batch about {1e-6 * needed:.0f} MB of memory"
    )
