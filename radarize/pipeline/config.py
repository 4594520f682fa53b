"""All settings of the pipeline in one place: ``radarize config`` prints them, ``radarize run --config mine.yaml`` reads
them."""

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
    """Settings of the pipeline, one section per step; the class of each section describes its fields."""

    heatmaps: HeatmapConfig = setting(HeatmapConfig(), "spectra and beamformers of the classical methods")
    scans: ScanConfig = setting(ScanConfig(), "echoes in range-azimuth maps, for scans without networks")
    doppler: DopplerConfig = setting(
        DopplerConfig(), "velocity from the Doppler speeds and directions of single echoes"
    )
    rotation: RotationConfig = setting(RotationConfig(), "rotation by matching frames with a local map")
    velocity: VelocityConfig = setting(VelocityConfig(), "filter of the velocities of any estimator")
    fusion: FusionConfig = setting(FusionConfig(), "fusion of velocities from the network and from Doppler")
    turns: TurnConfig = setting(TurnConfig(), "rotation by the network")
    slam: SlamConfig = setting(SlamConfig.preset("radar"), "SLAM back end")

    @classmethod
    def load(cls, path: str | Path) -> "Configuration":
        """Read settings from a YAML file, with sections and fields named as here; what is missing has its default.

        Raises:
            InputError: no such file, or a field that does not exist or has an impossible value.
        """
        return read_settings(path, cls(), "sections as `radarize config` prints")

    def text(self) -> str:
        """Return the settings as YAML, with the description of each field as a comment."""
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
