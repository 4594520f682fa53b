"""Order of the words in a raw capture that differs from the two lanes of a DCA1000 (`radarize.radar.dca1000`).

``pairs``        one receiver after the other, I of two samples and then their Q: IWR16xx to 68xx
``interleaved``  sample by sample I of all receivers, then their Q: the four lanes of xWR12xx and xWR14xx (SWRA581)
``real``         one receiver after the other, `samples` real samples, which are converted to half as many complex ones
                 at half the rate
"""

import numpy as np
from jaxtyping import Int16

from radarize.io.errors import InputError
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import decode, range_balance

LAYOUTS = ("pairs", "interleaved", "real")
#: dB of near over far energy from which on a layout is plausible, and by which another one must be better.
_RIGHT, _BETTER = 10.0, 8.0
#: Number of chirps of one transmitter that are examined.
_ASKED = 256

Words = Int16[np.ndarray, "word"]
Frames = Int16[np.ndarray, "frame loop tx rx sample 2"]


def recorded(config: RadarConfig, layout: str) -> RadarConfig:
    """Return the configuration of the decoded samples.

    Raises:
        InputError: the number of real samples is no multiple of four.
    """
    if layout != "real" or config.iq_order == "real":  # already counted in complex samples
        return config
    if config.samples % 4:
        raise InputError(f"samples is {config.samples}, expected a multiple of four real samples")
    halved = {"samples": config.samples // 2, "sample_rate": config.sample_rate / 2, "iq_order": "real"}
    return config.model_copy(update=halved)


def arranged(words: Words, config: RadarConfig, layout: str) -> Frames:
    """Decode the words of frames in a layout.

    Args:
        words: words of complete frames.
        config: configuration from `recorded`.
    """
    if layout != "interleaved":
        return decode(words, config)
    loops, tx, rx, samples, _ = config.frame_shape
    chirps = words.reshape(-1, loops, tx, samples, 2, rx).transpose(0, 1, 2, 5, 3, 4)
    chirps = chirps[..., ::-1] if config.iq_order == "qqii" else chirps
    return np.ascontiguousarray(chirps[:, :, list(config.slot)])


def likely(words: Words, config: RadarConfig, layout: str) -> str:
    """Return the layout that the samples clearly have instead of `layout`, or `layout`.

    Echoes are near, and leakage is nearest: decoded correctly, samples have far more energy at near than at far range.
    Decoded wrongly, receivers or I and Q alternate within a chirp, which spreads the energy over range.

    Args:
        words: first words of the capture.
        config: configuration from the capture's settings.
    """
    nearer = {name: _nearer(words, config, name) for name in LAYOUTS}
    best = max(nearer, key=nearer.__getitem__)
    return best if nearer[best] > _RIGHT and nearer[best] > nearer[layout] + _BETTER else layout


def _nearer(words: Words, config: RadarConfig, layout: str) -> float:
    """Return near over far energy, dB, for either order of I and Q; 0 if there are too few words."""
    if layout == "real" and config.iq_order != "real" and config.samples % 4:
        return 0.0
    of_one = recorded(config, layout).model_copy(update={"loops": 1, "tx_order": (0,), "bpm": None})
    count = min(len(words) // (of_one.frame_bytes // 2), _ASKED)
    if not count:
        return 0.0
    return abs(range_balance(arranged(words[: count * (of_one.frame_bytes // 2)], of_one, layout)))
