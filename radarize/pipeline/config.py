"""All that somebody may want to set of the pipeline, in one place: ``radarize config`` prints it, and ``radarize run
--config mine.yaml`` takes it."""

import json
from collections.abc import Iterator
from pathlib import Path
from textwrap import wrap

from pydantic import BaseModel

from radarize.io.plain import Frozen, setting
from radarize.io.yamlfile import read_settings
from radarize.odometry.doppler import DopplerConfig
from radarize.odometry.integration import VelocityConfig
from radarize.odometry.rotation import RotationConfig
from radarize.odometry.settings import FusionConfig, TurnConfig
from radarize.scans.extraction import ScanConfig
from radarize.signal.heatmaps import HeatmapConfig
from radarize.slam.config import SlamConfig


class Configuration(Frozen):
    """The pipeline's settings; each section belongs to one step, and is described where that step stands."""

    heatmaps: HeatmapConfig = setting(HeatmapConfig(), "spectra and beamformers of the classical methods")
    scans: ScanConfig = setting(ScanConfig(), "echoes in range-azimuth maps, of scans without networks")
    doppler: DopplerConfig = setting(DopplerConfig(), "velocity from single echoes")
    rotation: RotationConfig = setting(RotationConfig(), "turns by matching frames with a local map")
    velocity: VelocityConfig = setting(VelocityConfig(), "filter of velocities, whoever tells them")
    fusion: FusionConfig = setting(FusionConfig(), "velocities by network and Doppler together")
    turns: TurnConfig = setting(TurnConfig(), "turns by the network")
    slam: SlamConfig = setting(SlamConfig.preset("radar"), "the back end")

    @classmethod
    def load(cls, path: str | Path) -> "Configuration":
        """The defaults with what a YAML file says otherwise: sections and fields named as here.

        Raises:
            InputError: no such file, or a field that does not exist or has an impossible value.
        """
        return read_settings(path, cls(), "sections as `radarize config` prints")

    def text(self) -> str:
        """As YAML, with what each field means beside it."""
        return "\n".join(_lines(self, "")) + "\n"


def _lines(section: BaseModel, indent: str) -> Iterator[str]:
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if field.description:
            yield from wrap(field.description, 118, initial_indent=f"{indent}# ", subsequent_indent=f"{indent}# ")
        if isinstance(value, BaseModel):
            yield f"{indent}{name}:"
            yield from _lines(value, indent + "  ")
        else:
            yield f"{indent}{name}: {json.dumps(value)}"
