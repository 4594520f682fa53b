"""Readings of the paper's pipeline: which heat maps the networks see, and which networks those are."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from torch import nn

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


#: What the physics asks for, and what the artefact does.
SETTINGS = {"corrected": Setting(MapMaker, NETS), "published": Setting(PublishedMaps, PUBLISHED_NETS)}
