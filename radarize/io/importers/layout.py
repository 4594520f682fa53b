"""How the words of a raw capture lie, where not as a DCA1000's two lanes write them (`radarize.radar.dca1000`).

``pairs``        a receiver after the other, two samples' I and then their Q: IWR16xx to 68xx
``interleaved``  sample by sample I of all receivers, then their Q: the four lanes of xWR12xx and xWR14xx (SWRA581)
``real``         a receiver after the other, real samples alone: `samples` of them, of which half as many complex ones
                 at half the rate are made
"""

import numpy as np
from jaxtyping import Int16

from radarize.io.errors import InputError
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import decode, range_balance

LAYOUTS = ("pairs", "interleaved", "real")
#: dB of nearer over farther energy, from which on samples are read right, and by which another reading is better.
_RIGHT, _BETTER = 10.0, 8.0
#: Chirps of one transmitter that are asked.
_ASKED = 256

Words = Int16[np.ndarray, "word"]
Frames = Int16[np.ndarray, "frame loop tx rx sample 2"]


def recorded(config: RadarConfig, layout: str) -> RadarConfig:
    """The configuration of what comes out of a capture.

    Raises:
        InputError: real samples that are no multiple of four.
    """
    if layout != "real" or config.iq_order == "real":  # which counts the complex ones already
        return config
    if config.samples % 4:
        raise InputError(f"samples is {config.samples}, expected a multiple of four real samples")
    halved = {"samples": config.samples // 2, "sample_rate": config.sample_rate / 2, "iq_order": "real"}
    return config.model_copy(update=halved)


def arranged(words: Words, config: RadarConfig, layout: str) -> Frames:
    """Frames of words that lie so.

    Args:
        words: of whole frames.
        config: `recorded`.
    """
    if layout != "interleaved":
        return decode(words, config)
    loops, tx, rx, samples, _ = config.frame_shape
    chirps = words.reshape(-1, loops, tx, samples, 2, rx).transpose(0, 1, 2, 5, 3, 4)
    chirps = chirps[..., ::-1] if config.iq_order == "qqii" else chirps
    return np.ascontiguousarray(chirps[:, :, list(config.slot)])


def likely(words: Words, config: RadarConfig, layout: str) -> str:
    """The layout that samples plainly have instead; `layout` where none is.

    Echoes are near, leakage nearest of all: read right, samples have far more energy at near range than far away. Read
    wrong, receivers or I and Q take turns within a chirp, which spreads all of it over range.

    Args:
        words: the capture's first ones.
        config: as the capture's settings say.
    """
    nearer = {name: _nearer(words, config, name) for name in LAYOUTS}
    best = max(nearer, key=nearer.__getitem__)
    return best if nearer[best] > _RIGHT and nearer[best] > nearer[layout] + _BETTER else layout


def _nearer(words: Words, config: RadarConfig, layout: str) -> float:
    """dB of energy at near range over that far away, whichever of I and Q is first; 0 where too few words are there."""
    if layout == "real" and config.iq_order != "real" and config.samples % 4:
        return 0.0
    of_one = recorded(config, layout).model_copy(update={"loops": 1, "tx_order": (0,), "bpm": None})
    count = min(len(words) // (of_one.frame_bytes // 2), _ASKED)
    if not count:
        return 0.0
    return abs(range_balance(arranged(words[: count * (of_one.frame_bytes // 2)], of_one, layout)))
