"""The networks of the paper (section 4), each with its uncertainty: small enough for two cores."""

from radarize.nets.motion import RotationNet, TranslationNet
from radarize.nets.segmentation import SegmentationNet

#: Networks by the name of their task.
NETS = {net.kind: net for net in (TranslationNet, RotationNet, SegmentationNet)}

__all__ = ["NETS", "RotationNet", "SegmentationNet", "TranslationNet"]
