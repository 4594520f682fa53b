"""From raw frames to odometry and scans as the published artefact does it: what `radarize.pipeline` runs in place of
its own with settings `published`."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Int16

from radarize.errors import InputError
from radarize.mapping import scans
from radarize.nets.weights import load
from radarize.odometry.integration import Track
from radarize.pose import between, wrap
from radarize.published import labels
from radarize.published.heatmaps import PublishedMaps
from radarize.radar.config import RadarConfig
from radarize.settings import SETTINGS

#: Frames of 15 Hz over which turns are told, and so interleaved chains of yaws.
CHAINS = 4
#: Column of the occupancy label nearest to each bearing of a scan.
_COLUMNS = np.abs(scans.BEARINGS[:, None] - labels.BEARINGS).argmin(axis=1)


class Chain:
    """The artefact's signal chain in a stream: push batches of frames of any size.

    Of 30 frames a second every second one is used. Velocities are integrated by Euler's rule with the heading before;
    yaws come in four interleaved chains, each turning by what the network says of four frames.

    Args:
        config: radar configuration.
        weights: folder of translation.safetensors, rotation.safetensors and segmentation.safetensors, which
            `radarize train --settings published` wrote.
        headings: true yaws of the first four frames that are used, rad, from which the artefact's chains start; zeros
            if None, as far as a radar alone can know.

    Attributes:
        stride: frames from one that is used to the next.

    Raises:
        InputError: no such weights, or they are for other maps.
    """

    def __init__(self, config: RadarConfig, weights: Path, headings: Float[np.ndarray, "4"] | None = None):
        self.config, self.maker = config, PublishedMaps(config)
        self.stride = self.maker.stride(config)
        self._nets = {kind: self._load(Path(weights) / f"{kind}.safetensors") for kind in SETTINGS["published"].nets}
        start = np.zeros(CHAINS) if headings is None else np.asarray(headings, float)
        self._start = wrap(start - start[0])
        self._frames = 0
        self._buffer: np.ndarray | None = None
        self._past: list[tuple[float, np.ndarray, torch.Tensor]] = []  # of CHAINS used frames: time, pose, maps

    def _load(self, path: Path) -> torch.nn.Module:
        net, header = load(path, self.config)
        if header.setting != "published":
            raise InputError(f"{path}: was trained with settings {header.setting!r}, expected 'published'")
        return net

    @torch.inference_mode()
    def push(
        self,
        adc: Int16[np.ndarray, "frame loop tx rx sample 2"],
        times: Float[np.ndarray, "frame"],
        stage: Callable[[str], AbstractContextManager] = nullcontext,
    ) -> tuple[Track, Float[np.ndarray, "used bearing"]]:
        """Poses and scans of those of the next frames that are used; there may be none.

        Args:
            adc: raw samples.
            times: the frames' stamps, s.
            stage: entered with each step's name, to time it.
        """
        skipped = -self._frames % self.stride
        self._frames += len(adc)
        before = 0 if self._buffer is None else len(self._buffer)
        frames = adc if self._buffer is None else np.concatenate([self._buffer, adc])
        self._buffer = frames[-self.maker.history :]
        instants = np.asarray(times, float)[skipped :: self.stride] + self.config.burst_center
        if not len(instants):
            return _no_track(), np.zeros((0, len(scans.BEARINGS)))
        with stage("maps"):
            made = self.maker(frames, names=self.maker.names, frames=slice(before + skipped, None, self.stride))

        def window(kind: str) -> torch.Tensor:
            return torch.stack([torch.from_numpy(made[name]).float() for name in self._nets[kind].maps], dim=1)

        with stage("translation"):
            velocity, velocity_noise = self._nets["translation"].estimate(window("translation")[:, None])
        with stage("rotation"):
            seen = torch.stack([maps for _, _, maps in self._past] + list(window("rotation")))
            pairs = torch.stack([seen[:-CHAINS], seen[CHAINS:]], dim=1)
            turn, turn_noise = self._nets["rotation"].estimate(pairs) if len(pairs) else (torch.zeros(0, 1),) * 2
        track = self._integrate(instants, velocity, velocity_noise, turn, turn_noise, seen[-len(instants) :])
        with stage("scans"):
            likely = self._nets["segmentation"].estimate(window("segmentation")[:, None])
        return track, first_occupied(likely.numpy())

    def _integrate(self, times, velocity, velocity_noise, turn, turn_noise, maps) -> Track:
        """Poses from velocities since the frame before and turns since four frames before."""
        velocity, turn = velocity.double().numpy(), turn[:, 0].double().numpy()
        poses, steps, spreads = np.zeros((len(times), 3)), np.zeros((len(times), 3)), np.zeros((len(times), 3, 3))
        late = len(times) - len(turn)  # frames of this batch that have none four before them
        for i, time in enumerate(times):
            if i < late:
                poses[i, 2] = self._start[len(self._past)]
            else:
                poses[i, 2] = wrap(self._past[-CHAINS][1][2] + turn[i - late])
                spreads[i, 2, 2] = turn_noise[0, 0, 0]
            if self._past:
                last, before, _ = self._past[-1]
                dt, cos, sin = time - last, np.cos(before[2]), np.sin(before[2])
                poses[i, :2] = before[:2] + dt * np.array([[cos, -sin], [sin, cos]]) @ velocity[i]
                steps[i] = between(before, poses[i])
                spreads[i, :2, :2] = dt**2 * velocity_noise[0].numpy()
            self._past = [*self._past[-CHAINS + 1 :], (time, poses[i].copy(), maps[i])]
        seen = np.ones((2, len(times)), bool)  # the artefact knows of no doubt
        return Track(times, poses, steps, spreads, velocity, velocity_noise.double().numpy(), *seen)


def first_occupied(likely: Float[np.ndarray, "frame range bearing"]) -> Float[np.ndarray, "frame bearing"]:
    """Range of the first cell that is occupied rather than free per bearing of a scan, m, inf where there is none."""
    cells = likely[:, :, _COLUMNS] > 0.5
    return np.where(cells.any(axis=1), labels.RANGES[cells.argmax(axis=1)], np.inf)


def _no_track() -> Track:
    none = np.zeros((0, 3))
    nothing = np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0, bool), np.zeros(0, bool)
    return Track(np.zeros(0), none, none, np.zeros((0, 3, 3)), *nothing)
