"""Readings of the paper's pipeline: which heat maps the networks see, and which networks those are."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from torch import nn

from radarize.baselines.milliego import MilliEgoNet
from radarize.baselines.radarhd import RadarHdNet
from radarize.baselines.rnin import RninNet
from radarize.nets import NETS
from radarize.published.heatmaps import PublishedMaps
from radarize.published.nets import PUBLISHED_NETS
from radarize.training.maps import Maker, MapMaker


@dataclass(frozen=True)
class Setting:
    """One reading.

    Attributes:
        maker: of the maps.
        nets: networks by the name of their task, each made from frames of a window, names of maps and width.
    """

    maker: type[Maker]
    nets: Mapping[str, Callable[..., nn.Module]]


#: Networks of the baselines, which see what those of the default setting see.
BASELINES = {net.kind: net for net in (RadarHdNet, MilliEgoNet, RninNet)}
#: What the physics asks for, and what the artefact does.
SETTINGS = {"corrected": Setting(MapMaker, NETS | BASELINES), "published": Setting(PublishedMaps, PUBLISHED_NETS)}
