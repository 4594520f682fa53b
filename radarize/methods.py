"""Every way to odometry and to scans, by name: what ``--odometry`` and ``--scans`` accept, and what benchmarks compare.

A new method is a class with a `follow` or a `scan`, and an entry here or, from elsewhere, in these dictionaries.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from copy import copy
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Generic, Protocol, TypeVar

import numpy as np
import torch
from jaxtyping import Bool, Complex64, Float, Int16

from radarize.baselines.odometry import MilliEgoOdometry, RninOdometry
from radarize.baselines.ransac import RansacVelocity
from radarize.baselines.scans import RadarHdScans
from radarize.errors import InputError
from radarize.heatmaps import Heatmaps
from radarize.mapping.scans import HeatmapScans
from radarize.mapping.segmentation import Segmentation
from radarize.nets.weights import check, shipped
from radarize.odometry.doppler import DopplerVelocity
from radarize.odometry.fused import FusedVelocity
from radarize.odometry.integration import Odometry, Track
from radarize.odometry.learned import LearnedRotation, LearnedVelocity
from radarize.odometry.rotation import MapRotation
from radarize.odometry.scanmatching import ScanMatching
from radarize.radar.config import RadarConfig
from radarize.recording import Recording
from radarize.training.maps import MapMaker


class Follower(Protocol):
    """Odometry of a stream of frames."""

    def follow(
        self,
        spectrum: Complex64[torch.Tensor, "frame range doppler antenna"],
        times: Float[np.ndarray, "frame"],
        stage: Callable[[str], AbstractContextManager] = nullcontext,
    ) -> Track:
        """Poses of the next frames, from `Heatmaps.spectrum` and stamps; `stage` is entered to time steps."""
        ...


class Scanner(Protocol):
    """Scans of a stream of frames."""

    def scan(
        self, spectrum: Complex64[torch.Tensor, "frame range doppler antenna"]
    ) -> Float[np.ndarray, "frame bearing"]:
        """Ranges of the next frames on `radarize.mapping.scans.BEARINGS`, m, inf where nothing is seen."""
        ...


class Weights:
    """Where the networks' weights lie.

    Args:
        folder: with ``translation.safetensors`` and so on, as `radarize train` writes them; the shipped ones if None.
    """

    def __init__(self, folder: Path | None = None):
        self.folder = folder

    def of(self, kind: str) -> Path:
        """File of a network."""
        return shipped(kind) if self.folder is None else self.folder / f"{kind}.safetensors"


#: A frame with a smaller share of its chirps is left out. On a simulated walk, with the rest of each burst lost, 95 %
#: of Doppler velocities are within 0.02 m/s from whole bursts, 0.06 m/s from an eighth, 0.21 m/s from a sixteenth.
LEAST_SHARE = 1 / 8


class Inputs:
    """What methods are made from. Those made from the same share spectra, maps, scans and odometry.

    Args:
        config: radar configuration.
        weights: of the networks; the shipped ones if None.
        scans: method whose scans odometry may use.
        recording: where other sensors' streams are; None on a live radar.
        stage: entered with the name of a step, to time it.

    Attributes:
        heatmaps: on a degree's grid.
        maker: of the networks' maps.
        frames: which of the next frames are neither lost nor silent, and their spectra (None if none is), from samples
            and the chirps that are valid.
    """

    def __init__(
        self,
        config: RadarConfig,
        weights: Weights | None = None,
        scans: str = "first-echo",
        recording: Recording | None = None,
        stage: Callable[[str], AbstractContextManager] = nullcontext,
    ):
        self.config, self.weights, self.scans = config, weights or Weights(), scans
        self.recording, self.stage = recording, stage
        self.heatmaps, self.maker = Heatmaps(config), MapMaker(config, stage=stage)
        self.frames: Callable[..., tuple[np.ndarray, torch.Tensor | None]] = self._whole
        self._scanners: dict[str, _OnceScanner] = {}
        self._followers: dict[tuple[str, str], _OnceFollower] = {}
        self._asked = False

    def beside(self, scans: str) -> "Inputs":
        """The same with other scans for odometry. From now on `frames` takes the same samples for the same frames."""
        if self.frames == self._whole:
            self.frames = _Once(self._whole)
        other = copy(self)
        other.scans = scans
        return other

    def _whole(
        self, adc: Int16[np.ndarray, "frame loop tx rx sample 2"], valid: Bool[np.ndarray, "frame loop tx"] | None
    ) -> tuple[Bool[np.ndarray, "frame"], Complex64[torch.Tensor, "whole range doppler antenna"] | None]:
        used = adc.reshape(len(adc), -1).any(axis=1)  # networks would see motion in nothing, too
        if valid is not None:
            used &= valid.mean(axis=(1, 2)) >= LEAST_SHARE
            valid = valid[used]
        with self.stage("spectra"):
            return used, self.heatmaps.spectrum(adc[used], valid) if used.any() else None

    def scanner(self, name: str | None = None) -> Scanner:
        """Scans by a key of `SCANS`, made once a batch however many ask; None: of the method chosen.

        Raises:
            InputError: unknown name, or see `Method`.
        """
        self._asked |= name is None
        name = name or self.scans
        if name not in self._scanners:
            self._scanners[name] = _OnceScanner(_method("scans", name, SCANS).make(self), self.stage)
        return self._scanners[name]

    def odometry(self, name: str) -> Follower:
        """Odometry by a key of `ODOMETRY`, which moves on once a batch however many ask.

        Raises:
            InputError: unknown name, or see `Method`.
        """
        for key in ((name, ""), (name, self.scans)):
            if key in self._followers:
                return self._followers[key]
        self._asked = False
        made = _OnceFollower(_method("odometry", name, ODOMETRY).make(self))
        return self._followers.setdefault((name, self.scans if self._asked else ""), made)

    def imu(self, method: str) -> Recording:
        """The recording, for a method that needs its IMU.

        Raises:
            InputError: there is none.
        """
        if self.recording is None:
            raise InputError(f"odometry is {method!r}, which reads a recording's IMU; a live radar has none")
        return self.recording


Answer = TypeVar("Answer")


class _Once(Generic[Answer]):
    """Remembers what was answered about the last batch."""

    def __init__(self, answer: Callable[..., Answer]):
        self._answer_to, self._batch, self._answer = answer, None, None

    def __call__(self, batch: object, *rest: object) -> Answer:
        if batch is not self._batch:
            self._batch, self._answer = batch, self._answer_to(batch, *rest)
        return self._answer


class _OnceScanner:
    def __init__(self, scanner: Scanner, stage: Callable[[str], AbstractContextManager]):
        self._scanner, self._stage = scanner, stage
        self.scan = _Once(self._scan)

    def _scan(self, spectrum: torch.Tensor) -> np.ndarray:
        with self._stage("scans"):
            return self._scanner.scan(spectrum)


class _OnceFollower:
    def __init__(self, follower: Follower):
        self.follow = _Once(follower.follow)


Made = TypeVar("Made")


@dataclass(frozen=True)
class Method(Generic[Made]):
    """A way to odometry or scans.

    Attributes:
        title: what tables call it.
        make: of what there is; raises InputError where it lacks something, such as weights for this radar or a stream.
        networks: kinds of weights that it needs.
    """

    title: str
    make: Callable[[Inputs], Made]
    networks: tuple[str, ...] = ()


def doppler(inputs: Inputs) -> Odometry:
    """Least squares over Doppler peaks, and matching against a local map: no networks."""
    return Odometry(inputs.config, DopplerVelocity(inputs.heatmaps), MapRotation(inputs.heatmaps))


def learned(inputs: Inputs) -> Odometry:
    """Networks alone (the paper)."""
    velocity = LearnedVelocity(inputs.maker, inputs.weights.of("translation"))
    return Odometry(inputs.config, velocity, LearnedRotation(inputs.maker, inputs.weights.of("rotation")))


def fused(inputs: Inputs) -> Odometry:
    """Both: velocities by their covariances, and the map matched from where the network says that it has turned to."""
    maker, weights = inputs.maker, inputs.weights
    velocity = FusedVelocity(LearnedVelocity(maker, weights.of("translation")), DopplerVelocity(maker.heatmaps))
    rotation = MapRotation(maker.heatmaps, prior=LearnedRotation(maker, weights.of("rotation")))
    return Odometry(inputs.config, velocity, rotation)


def scan_matching(inputs: Inputs) -> ScanMatching:
    """Scans alone, whatever they are made with."""
    return ScanMatching(inputs.config, inputs.scanner())


def ransac(inputs: Inputs) -> Odometry:
    """Least squares over a sparse point cloud, in the place of `doppler`'s."""
    return Odometry(inputs.config, RansacVelocity(inputs.heatmaps), MapRotation(inputs.heatmaps))


def milliego(inputs: Inputs) -> MilliEgoOdometry:
    """A sparse point cloud and an IMU."""
    return MilliEgoOdometry(inputs.heatmaps, inputs.imu("milliego"), inputs.weights.of("milliego"))


def rnin(inputs: Inputs) -> RninOdometry:
    """An IMU alone."""
    return RninOdometry(inputs.heatmaps, inputs.imu("rnin"), inputs.weights.of("rnin"))


def radarhd(inputs: Inputs) -> RadarHdScans:
    """Pictures like a lidar's."""
    return RadarHdScans(inputs.maker, inputs.weights.of("radarhd"))


def segmentation(inputs: Inputs) -> Segmentation:
    """The network's first surfaces."""
    return Segmentation(inputs.maker, inputs.weights.of("segmentation"))


def segmentation_alone(inputs: Inputs) -> Segmentation:
    """The network without the first echo rule."""
    return Segmentation(inputs.maker, inputs.weights.of("segmentation"), first=False)


def of_heatmaps(method: str, inputs: Inputs) -> HeatmapScans:
    """No networks."""
    return HeatmapScans(inputs.heatmaps, method, stage=inputs.stage)


ODOMETRY: dict[str, Method[Follower]] = {
    "fused": Method("networks and Doppler", fused, ("translation", "rotation")),
    "learned": Method("networks", learned, ("translation", "rotation")),
    "doppler": Method("Doppler least squares", doppler),
    "doppler-ransac": Method("Doppler RANSAC", ransac),
    "scan-matching": Method("scan matching", scan_matching),
    "milliego": Method("milliEgo", milliego, ("milliego",)),
    "rnin": Method("RNIN", rnin, ("rnin",)),
}
SCANS: dict[str, Method[Scanner]] = {
    "segmentation": Method("segmentation network, first echo", segmentation, ("segmentation",)),
    "segmentation-alone": Method("segmentation network alone", segmentation_alone, ("segmentation",)),
    "radarhd": Method("RadarHD", radarhd, ("radarhd",)),
    "elevation-aware": Method("elevation-aware first echo", partial(of_heatmaps, "elevation-aware")),
    "first-echo": Method("first echo", partial(of_heatmaps, "first-echo")),
    "cfar": Method("CFAR", partial(of_heatmaps, "cfar")),
    "threshold": Method("threshold", partial(of_heatmaps, "threshold")),
}
#: Methods of choice.
BEST = {"odometry": "fused", "scans": "segmentation"}
#: Methods without networks, for radars that the shipped ones do not fit.
CLASSICAL = {"odometry": "doppler", "scans": "first-echo"}


def best_methods(config: RadarConfig) -> tuple[dict[str, str], str]:
    """Odometry and scans of choice for a radar, and if these are the classical ones, why."""
    networks = (*ODOMETRY[BEST["odometry"]].networks, *SCANS[BEST["scans"]].networks)
    try:
        for kind in networks:
            check(shipped(kind), config)
    except InputError as error:
        return CLASSICAL, str(error)
    return BEST, ""


def _method(what: str, name: str, known: dict[str, Method]) -> Method:
    if name not in known:
        raise InputError(f"{what} is {name!r}, expected one of {', '.join(known)}")
    return known[name]
