"""Report of a recording, real or simulated, as an HTML page."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Int
from scipy.signal import find_peaks

from radarize.evaluation.report.contents import contents, data_sets
from radarize.evaluation.report.drawings import LEAKAGE, canvas, draw_doppler, draw_fan, draw_profiles
from radarize.evaluation.report.page import COLORS, INK, Page
from radarize.evaluation.report.plots import from_above, line, panels, walls
from radarize.evaluation.report.sensors import show_sensors
from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.radar.array import azimuth_row
from radarize.signal import polar
from radarize.signal.heatmaps import Heatmaps

#: Maximum number of range profiles over time; number of frames with heat maps.
_PROFILES, _FRAMES = 400, 3
#: Maximum number of echoes that are listed from the mean range profile, and their minimum prominence, dB.
_ECHOES, _PROMINENCE = 10, 4.0
#: Largest magnitude of a 16-bit sample.
_FULL_SCALE = 32767


def report_recording(path: Path, output: Path | None = None) -> Path:
    """Write a report of a recording.

    Args:
        path: recording.
        output: page to write; by default the path of the recording with ``.html`` in place of ``.h5``.

    Raises:
        InputError: not a recording, an empty or damaged one.
    """
    path = Path(path)
    found = contents(path)
    output = Path(output) if output else path.with_suffix(".html")
    with Recording(path) as recording:
        if not len(recording):
            raise InputError(f"{path}: has no whole frame, expected at least one")
        config = recording.config
        page = Page(
            f"Recording {path.name}",
            f"{len(recording)} frames in {found['duration']:.2f} s · {config.board} · {len(config.tx)} transmitters, "
            f"{len(config.rx)} receivers, {config.loops} loops, {config.samples} samples",
        )
        page.headline(
            [
                (f"{100 * config.range_resolution:.2f} cm", "range resolution"),
                (f"{config.max_range:.2f} m", "largest range"),
                (f"±{config.max_velocity:.2f} m/s", "unambiguous radial speed"),
                (f"{100 * found['lost_share']:.2g} %", f"chirps lost ({found['lost_chirps']})"),
            ]
        )
        for words in found["damage"]:
            page.text(f"{words[:1].upper()}{words[1:]}.")
        shown = np.unique(np.linspace(0, len(recording) - 1, _FRAMES).astype(int))
        if polar.pictured(recording):
            _pictures(page, recording, shown)
        else:
            maps = Heatmaps(config)
            _profiles(page, recording, maps)
            _maps(page, recording, maps)
            _samples(page, recording)
        show_sensors(page, recording, shown)
        if recording.has("truth/pose"):
            _trajectory(page, recording)
    page.section("Contents")
    page.table(*data_sets(found))
    fields = {name: value for name, value in found["config"].items() if name != "channel_calibration"}
    fields["board"] = str(recording.config.board)
    page.columns({"configuration (SI units)": fields, "derived": found["derived"], "attributes": found["attributes"]})
    return page.write(output)


def _batches(recording: Recording, count: int) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """Yield frames spread evenly over the recording, one at a time: index, samples, valid."""
    for index in np.unique(np.linspace(0, len(recording) - 1, count).astype(int)):
        yield index, recording.adc(index, index + 1), recording.valid(index, index + 1)


def _profiles(page: Page, recording: Recording, maps: Heatmaps) -> None:
    profiles = {k: maps.range_profile(adc, valid)[0].numpy() for k, adc, valid in _batches(recording, _PROFILES)}
    power = np.stack(list(profiles.values()))
    times = recording.times[list(profiles)] - recording.times[0]
    page.section("Range", "Mean power over range, over all antennas and speeds, in dB relative to the strongest echo.")
    if len(times) > 1:
        figure, axes = canvas(1, height=3.0)
        draw_profiles(axes[0, 0], times, maps.ranges, power)
        page.picture(figure, "Range profile over time")
    mean = power.mean(axis=0)
    far = maps.ranges >= LEAKAGE
    top = mean[far].max() if far.any() else mean.max()
    level = 10 * np.log10(np.maximum(mean, top * 1e-9) / top) if top > 0 else np.zeros(len(mean))
    found, properties = find_peaks(np.where(far, level, level.min()), prominence=_PROMINENCE)
    strongest = np.sort(found[np.argsort(-properties["prominences"])[:_ECHOES]])
    figure = panels("mean power, dB", x="range, m")
    line(figure, (maps.ranges, level), "mean", COLORS["odometry"])
    echoes = maps.ranges[strongest], level[strongest]
    line(figure, echoes, "echoes", COLORS["slam"], mode="markers", marker={"color": COLORS["slam"], "size": 7})
    figure.update_yaxes(range=[max(level[far].min() - 3, -80) if far.any() else -80, 8])
    page.plot(figure, height=360)
    if len(strongest):
        page.text("Echoes: " + ", ".join(f"{r:.2f} m ({p:.0f} dB)" for r, p in zip(*echoes, strict=True)) + ".")


def _maps(page: Page, recording: Recording, maps: Heatmaps) -> None:
    antennas = len(azimuth_row(recording.config))
    if antennas < 2:
        page.section("Azimuth", "With a single virtual antenna there are no maps over azimuth.")
        return
    about = f"From the longest row of {antennas} virtual antennas"
    if maps.pairs is None:
        about += "; without antennas at two heights there is no elevation-aware map"
    else:
        about += f", and {len(maps.pairs)} vertical pairs that attenuate ceiling and floor"
    about += ". From above: forward is up, left is left. Level in dB relative to the strongest cell."
    page.section("Azimuth", about)
    for index, adc, valid in _batches(recording, _FRAMES):
        fans: dict[str, Callable[[np.ndarray, np.ndarray], torch.Tensor]] = {"range-azimuth": maps.range_azimuth}
        if maps.pairs is not None:
            fans["elevation aware"] = maps.elevation_aware
        figure, axes = canvas(len(fans) + 1)
        for axis, (title, make) in zip(axes[0], fans.items(), strict=False):
            draw_fan(axis, make(adc, valid)[0].numpy(), maps.ranges, maps.azimuths, title)
        known = (
            recording.rows("truth/velocity", index, index + 1) if recording.has("truth/velocity") else np.empty((0, 2))
        )
        velocity = known[0, :2] if len(known) else None
        speeds = maps.doppler_azimuth(adc, valid)[0].numpy()
        draw_doppler(axes[0, -1], speeds, maps.velocities, maps.azimuths, "Doppler-azimuth", velocity)
        page.picture(figure, f"Frame {index}, {recording.times[index] - recording.times[0]:.2f} s after the start")


def _pictures(page: Page, recording: Recording, shown: Int[np.ndarray, "picture"]) -> None:
    about = (
        "Polar pictures; the recording has no samples. From above: forward is up, left is left. Level in dB relative "
        "to the strongest cell."
    )
    page.section("Azimuth", about)
    figure, axes = canvas(len(shown))
    for axis, index in zip(axes[0], shown, strict=True):
        picture = polar.power(recording.rows(polar.PICTURE, index, index + 1))[0]
        title = f"frame {index}, {recording.times[index] - recording.times[0]:.2f} s"
        draw_fan(axis, picture, polar.RANGES, polar.AZIMUTHS, title)
    page.picture(figure, "Pictures of three frames")


def _samples(page: Page, recording: Recording) -> None:
    counts = np.zeros(1 << 16, int)
    for _, adc, _ in _batches(recording, 40):
        counts += np.bincount(adc.ravel().astype(np.int32) + 32768, minlength=len(counts))
    values = np.arange(-32768, 32768)
    clipped = counts[np.abs(values) >= _FULL_SCALE].sum() / counts.sum()
    largest = int(np.abs(values[counts > 0]).max())
    page.section(
        "Samples",
        f"Largest magnitude {largest} of {_FULL_SCALE} ADC counts; {100 * clipped:.3g} % of the samples are clipped.",
    )
    step = max(1, largest // 60)
    edges = np.arange(-largest - step, largest + 2 * step, step)
    total, _ = np.histogram(values, edges, weights=counts)
    figure = panels("samples", x="ADC counts (I and Q)")
    figure.add_bar(x=edges[:-1], y=total, offset=0, marker={"color": COLORS["map"]})
    figure.update_layout(bargap=0.05)
    figure.update_yaxes(type="log")
    page.plot(figure, height=300)
    lost = (~recording.valid(0, len(recording))).sum(axis=(1, 2))
    if lost.any():
        figure = panels("lost chirps per frame")
        figure.add_bar(x=recording.times - recording.times[0], y=lost, marker={"color": COLORS["slam"]})
        page.plot(figure, height=240)


def _trajectory(page: Page, recording: Recording) -> None:
    page.section("True trajectory")
    figure = from_above()
    if recording.has("truth/floor_plan"):
        line(figure, walls(recording.read("truth/floor_plan")), "floor plan", COLORS["truth"], 1.2)
    path = recording.read("truth/pose")[:, :2]
    line(figure, path, "sensor", COLORS["good"], 2.4)
    line(figure, path[:1], "start", INK, mode="markers", marker={"color": INK, "size": 9})
    page.plot(figure, height=520)
