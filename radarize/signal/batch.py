"""What goes through the pipeline: a batch of frames, and what is made of them, once, when somebody asks for it."""

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

#: A frame with a smaller share of its chirps is left out. On a simulated walk, with the rest of each burst lost, 95 %
#: of Doppler velocities are within 0.02 m/s from whole bursts, 0.06 m/s from an eighth, 0.21 m/s from a sixteenth.
LEAST_SHARE = 1 / 8


class Signal:
    """What turns samples of one radar into spectra, maps and points; all batches of a stream share it."""

    def __init__(self, radar: RadarConfig, settings: HeatmapConfig | None = None):
        self.radar = radar
        self.heatmaps = Heatmaps(radar, settings=settings)
        self.aliases, self.receivers = Aliases(radar), Receivers(radar)

    @cached_property
    def maker(self) -> MapMaker:
        """Of the maps that networks see."""
        return MapMaker(self.radar)

    @cached_property
    def clouds(self) -> PointClouds:
        """Of many sparse points.

        Raises:
            InputError: see `PointClouds`.
        """
        return PointClouds(self.radar, DENSE)


class Batch:
    """Consecutive frames, none of them lost or silent.

    Args:
        signal: what makes something of them.
        samples: raw I/Q; None where nothing but maps is known.
        stamps: starts of the frames' first chirps, s.
        valid: False where a chirp was lost; all true if None.
        numbers: of the frames as the radar sent them, see `Numbering`; from 0 if None.
        maps: that are known already, such as pictures of a radar whose samples nobody kept.

    Attributes:
        flaws: of the frames; None where nobody looked.
        ranges: scans of the frames, once they are extracted (`radarize.pipeline.pipeline.ScanExtractor`), m.
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
        """Burst centres, s: the instants that motion and scans belong to."""
        return self.stamps + self.signal.radar.burst_center

    @cached_property
    def folded(self) -> Complex64[torch.Tensor, "frame range doppler antenna"]:
        """See `Heatmaps.spectrum`; broken receivers are filled in.

        Raises:
            InputError: nothing but maps is known.
        """
        if self.samples is None:
            raise InputError(f"frames from {self.stamps[0]:.3f} s on have no samples, only {', '.join(self.known)}")
        with stage("spectra"):
            spectrum = self.signal.heatmaps.spectrum(self.samples, self.valid)
            return spectrum if self.flaws is None else self.signal.receivers.filled(spectrum, self.flaws.broken)

    @cached_property
    def aliases(self) -> Int[np.ndarray, "frame doppler"]:
        """See `Aliases.of`."""
        with stage("spectra"):
            return self.signal.aliases.of(self.folded)

    @cached_property
    def spectrum(self) -> Complex64[torch.Tensor, "frame range doppler antenna"]:
        """`folded`, with the antennas of each bin as if sampled at once at the speed that it means."""
        return self.signal.heatmaps.unfolded(self.folded, self.aliases)

    def maps(self, names: tuple[str, ...]) -> dict[str, Shaped[np.ndarray, "frame row azimuth"]]:
        """Maps that networks see, dB, see `radarize.signal.maps`."""
        missing = tuple(name for name in names if name not in self.known)
        if missing:
            self.known.update(self.signal.maker.of(self.spectrum, missing))
        return {name: self.known[name] for name in names}

    @cached_property
    def points(self) -> tuple[Float[np.ndarray, "point 6"], Int[np.ndarray, "point"]]:
        """Sparse points and the frame of the batch that each belongs to, see `PointClouds`."""
        with stage("points"):
            return self.signal.clouds.of(self.signal.heatmaps, self.spectrum)


class Preprocessor:
    """Makes batches of what a radar delivers.

    Args:
        signal: of a radar that delivers no more than what is taken; see `RadarConfig.every`.
        every: only frames are taken whose number is a multiple of it.

    Attributes:
        taken: frames so far.
        lost: of these, frames that are lost, nearly lost, or silent: left out, for a gap says more than nothing does.
        disturbed: chirps that were disturbed, which count as lost.
        numbering: of all frames, also of those that are not taken.
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
        """The next frames, see `Batch`, without those that are left out."""
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
        """The next frames of a recording that holds maps and no samples."""
        numbers = self.numbering.of(stamps)
        wanted = numbers % self.every == 0
        self.taken += int(np.count_nonzero(wanted))
        shown = {name: each[wanted] for name, each in maps.items()}
        return Batch(self.signal, None, stamps[wanted], numbers=numbers[wanted], maps=shown)
