"""Batch of frames with its products (spectra, maps, points), each computed once on first use."""

from collections.abc import Mapping
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Bool, Complex64, Float, Int, Int16, Shaped

from radarize.io.errors import InputError
from radarize.io.stopwatch import stage
from radarize.radar.config import RadarConfig
from radarize.radar.numbering import Numbering
from radarize.signal.aliasing import Aliases
from radarize.signal.disturbance import Flaws, find_flaws
from radarize.signal.heatmaps import HeatmapConfig, Heatmaps
from radarize.signal.maps import MapMaker
from radarize.signal.points import DENSE, PointClouds
from radarize.signal.receivers import Receivers

#: Smallest fraction of its chirps with which a frame is used. On a simulated walk, with the rest of each burst lost,
#: 95 % of Doppler velocities are within 0.02 m/s from whole bursts, 0.06 m/s from an eighth, 0.21 m/s from a sixteenth.
LEAST_SHARE = 1 / 8


class Signal:
    """Signal processing of one radar: spectra, maps and points; shared by all batches of a stream."""

    def __init__(self, radar: RadarConfig, settings: HeatmapConfig | None = None):
        self.radar = radar
        self.heatmaps = Heatmaps(radar, settings=settings)
        self.aliases, self.receivers = Aliases(radar), Receivers(radar)

    @cached_property
    def maker(self) -> MapMaker:
        """Maker of the networks' input maps."""
        return MapMaker(self.radar)

    @cached_property
    def clouds(self) -> PointClouds:
        """Point clouds with many sparse points.

        Raises:
            InputError: see `PointClouds`.
        """
        return PointClouds(self.radar, DENSE)


class Batch:
    """Consecutive frames, none of them lost or without signal.

    Args:
        signal: signal processing of the radar.
        samples: raw I/Q; None if only maps are available.
        stamps: start times of the frames' first chirps, s.
        valid: False where a chirp was lost; all true if None.
        numbers: frame numbers as sent by the radar, see `Numbering`; default: from 0.
        maps: maps that are available already, such as those of a recording without samples.

    Attributes:
        flaws: defects of the frames; None if they were not examined.
        ranges: scans of the frames, once extracted (`radarize.pipeline.pipeline.ScanExtractor`), m.
        known: maps by name.
    """

    flaws: Flaws | None = None
    ranges: Float[np.ndarray, "frame bearing"] | None = None

    def __init__(
        self,
        signal: Signal,
        samples: Int16[np.ndarray, "frame loop tx rx sample 2"] | None,
        stamps: Float[np.ndarray, "frame"],
        valid: Bool[np.ndarray, "frame loop tx"] | None = None,
        numbers: Int[np.ndarray, "frame"] | None = None,
        maps: Mapping[str, Shaped[np.ndarray, "frame row azimuth"]] | None = None,
    ):
        self.signal, self.samples, self.valid = signal, samples, valid
        self.stamps = np.asarray(stamps, float)
        self.numbers = np.arange(len(self.stamps)) if numbers is None else numbers
        self.known = dict(maps or {})

    def __len__(self) -> int:
        return len(self.stamps)

    @cached_property
    def centers(self) -> Float[np.ndarray, "frame"]:
        """Burst centres, s: the times to which motion and scans refer."""
        return self.stamps + self.signal.radar.burst_center

    @cached_property
    def folded(self) -> Complex64[torch.Tensor, "frame range doppler antenna"]:
        """Spectrum with broken receivers filled in, before the ambiguity of speeds is resolved; see
        `Heatmaps.spectrum`.

        Raises:
            InputError: only maps are available.
        """
        if self.samples is None:
            raise InputError(f"frames from {self.stamps[0]:.3f} s on have no samples, only {', '.join(self.known)}")
        with stage("spectra"):
            spectrum = self.signal.heatmaps.spectrum(self.samples, self.valid)
            return spectrum if self.flaws is None else self.signal.receivers.filled(spectrum, self.flaws.broken)

    @cached_property
    def aliases(self) -> Int[np.ndarray, "frame doppler"]:
        """Number of unambiguous spans to add to the speed of each Doppler bin, see `Aliases.of`."""
        with stage("spectra"):
            return self.signal.aliases.of(self.folded)

    @cached_property
    def spectrum(self) -> Complex64[torch.Tensor, "frame range doppler antenna"]:
        """`folded` with ambiguity resolved: the delays between transmitters compensated at each bin's true speed."""
        return self.signal.heatmaps.unfolded(self.folded, self.aliases)

    def maps(self, names: tuple[str, ...]) -> dict[str, Shaped[np.ndarray, "frame row azimuth"]]:
        """Input maps of networks, dB, see `radarize.signal.maps`."""
        missing = tuple(name for name in names if name not in self.known)
        if missing:
            self.known.update(self.signal.maker.of(self.spectrum, missing))
        return {name: self.known[name] for name in names}

    @cached_property
    def points(self) -> tuple[Float[np.ndarray, "point 6"], Int[np.ndarray, "point"]]:
        """Sparse points and the index of the frame of each, see `PointClouds`."""
        with stage("points"):
            return self.signal.clouds.of(self.signal.heatmaps, self.spectrum)


class Preprocessor:
    """Make batches from the frames of a radar.

    Args:
        signal: signal processing of a radar with the frame rate after decimation; see `RadarConfig.every`.
        every: use only frames whose number is a multiple of this.

    Attributes:
        taken: number of frames used so far.
        lost: number of these that are lost, nearly lost, or without signal, and left out.
        disturbed: number of disturbed chirps, which count as lost.
        numbering: numbers of all frames, also of those not used.
    """

    def __init__(self, signal: Signal, every: int = 1):
        self.signal, self.every = signal, every
        self.taken = self.lost = self.disturbed = 0
        self.numbering = Numbering(signal.radar.frame_period / every)

    def process(
        self,
        samples: Int16[np.ndarray, "frame loop tx rx sample 2"],
        stamps: Float[np.ndarray, "frame"],
        valid: Bool[np.ndarray, "frame loop tx"] | None = None,
    ) -> Batch:
        """Process the next frames; returns a `Batch` without those that are left out."""
        stamps = np.asarray(stamps, float)
        numbers = self.numbering.of(stamps)
        valid = np.ones(samples.shape[:3], bool) if valid is None else valid
        if self.every > 1:
            wanted = numbers % self.every == 0
            samples, stamps, valid, numbers = samples[wanted], stamps[wanted], valid[wanted], numbers[wanted]
        flaws = find_flaws(samples, valid)
        valid = valid & ~flaws.disturbed
        used = samples.any(axis=(1, 2, 3, 4, 5)) & (valid.mean(axis=(1, 2)) >= LEAST_SHARE)
        self.taken += len(used)
        self.lost += int(np.count_nonzero(~used))
        self.disturbed += int(np.count_nonzero(flaws.disturbed))
        batch = Batch(self.signal, samples[used], stamps[used], valid[used], numbers[used])
        batch.flaws = flaws.of(used)
        return batch

    def process_maps(
        self, maps: Mapping[str, Shaped[np.ndarray, "frame row azimuth"]], stamps: Float[np.ndarray, "frame"]
    ) -> Batch:
        """Process the next frames of a recording with maps and without samples."""
        numbers = self.numbering.of(stamps)
        wanted = numbers % self.every == 0
        self.taken += int(np.count_nonzero(wanted))
        shown = {name: each[wanted] for name, each in maps.items()}
        return Batch(self.signal, None, stamps[wanted], numbers=numbers[wanted], maps=shown)
