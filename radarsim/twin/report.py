"""Report on a recording and its twin: one page with both side by side, and all figures as JSON beside it."""

import json
from collections.abc import Callable
from itertools import cycle
from pathlib import Path

import numpy as np
from plotly.colors import qualitative
from plotly.subplots import make_subplots

from radarize.evaluation.report.drawings import canvas, draw_doppler, draw_fan, draw_profiles, draw_scan
from radarize.evaluation.report.page import COLORS, INK, Page
from radarize.evaluation.report.plots import line, panels
from radarize.io.recording import Recording
from radarize.io.replacing import write_whole
from radarize.signal.bearings import BEARINGS
from radarize.signal.heatmaps import Heatmaps
from radarsim.twin.comparison import FIGURES, Comparison, compare

#: Largest number of range profiles over time in the picture.
_PROFILES = 400
_WHO = (("recording", COLORS["slam"]), ("twin", COLORS["odometry"]), ("poses", COLORS["truth"]))
#: Unit, factor to it, and probable cause of a shift.
_SHIFTED = {
    "time": ("s", 1.0, "the clocks of poses and radar differ"),
    "azimuth": ("deg", 180 / np.pi, "the poses' heading, the mounting or the scene is turned"),
    "range": ("m", 1.0, "the radar's range bias, a lever arm or the scene's size is wrong"),
}


def report_twin(
    real: Path, twin: Path, output: Path | None = None, progress: Callable[[int, int], None] | None = None
) -> tuple[Path, list[str]]:
    """Compare a recording with its twin and write a report.

    Args:
        real, twin: recordings, see `compare`.
        output: page to write (``.html``), by default beside the twin; the figures go beside it (``.json``).
        progress: called with (frames done, total frames).

    Returns:
        Path of the page, and the main figures, one sentence each.

    Raises:
        InputError: see `compare`, or a file cannot be written.
    """
    real, twin = Path(real), Path(twin)
    output = Path(output) if output else twin.with_suffix(".html")
    found = compare(real, twin, progress)
    summary = {"recording": real.name, "twin": twin.name, **found.summary()}
    write_whole(output.with_suffix(".json"), json.dumps(summary, indent=1) + "\n")
    with Recording(real) as one, Recording(twin) as other:
        page = Page(
            f"{real.name} and its twin",
            f"{len(found.frames)} of {len(one)} frames, simulated again in {other.attributes.get('scene', 'a scene')}",
        )
        page.headline(_headline(summary["figures"]))
        for words in _doubts(found, str(other.attributes.get("warnings", ""))):
            page.text(words)
        _table(page, summary)
        _alignment(page, found)
        _profiles(page, found)
        if len(found.scans):
            _frames(page, found, one, other)
            _velocities(page, found)
        _over_time(page, found)
        page.section("How the twin was made")
        facts = {n: v for n, v in other.attributes.items() if n not in ("front_end", "motion")}
        nested = {
            name.replace("_", " "): json.loads(str(other.attributes[name]))
            for name in ("motion", "front_end") if name in other.attributes
        }  # fmt: skip
        page.columns({"twin": facts, **nested})
    sentences = [f"{words}: {value}" for value, words in _headline(summary["figures"])]
    return page.write(output), sentences + _doubts(found, "")


def _headline(figures: dict) -> list[tuple[str, str]]:
    shown = (
        ("correlation_range_azimuth", 1.0, "{:.2f}", "correlation of range-azimuth maps"),
        ("similarity_range_azimuth", 1.0, "{:.2f}", "MS-SSIM of range-azimuth maps"),
        ("profile_correlation", 1.0, "{:.2f}", "correlation of range profiles"),
        ("velocity", 1.0, "{:.3f} m/s", "between the velocities"),
        ("bearings_within_10cm", 100.0, "{:.0f} %", "of bearings within 10 cm"),
        ("noise", 1.0, "{:.1f} dB", "noise floor, twin over recording"),
    )
    return [
        (form.format(factor * figures[n]["median"] + 0.0), words) for n, factor, form, words in shown if n in figures
    ]


def _doubts(found: Comparison, warnings: str) -> list[str]:
    """Warnings about conditions that make the comparison meaningless."""
    doubts = [warnings[0].upper() + warnings[1:] + "."] if warnings else []
    for name, (shift, gain) in found.misfits().items():
        unit, factor, reason = _SHIFTED[name]
        doubts.append(
            f"Maps correlate by {gain:.2f} better with the twin shifted by {factor * shift:+.3g} {unit} in {name}: "
            f"probably {reason}."
        )
    if not len(found.scans):
        doubts.append("A single virtual antenna gives no direction: no maps, velocities or scans to compare.")
    return doubts


def _table(page: Page, summary: dict) -> None:
    page.section(
        "Figures",
        "Medians over frames, with the middle 80 %; for scale, the median between unrelated frames, half a recording "
        "apart.",
    )

    def text(value: float | None) -> str:
        return "" if value is None else f"{value:.3g}"

    rows = [
        (FIGURES[name][1], FIGURES[name][0], text(f["median"]), f"{text(f['p10'])} … {text(f['p90'])}",
         text(f["unrelated_frames"]))
        for name, f in summary["figures"].items()
    ]  # fmt: skip
    page.table(("figure", "unit", "median", "10 … 90 %", "unrelated frames"), rows, numbers=(2, 3, 4))
    noise = summary["noise_counts"]
    if None not in noise.values():
        page.text(f"Noise floor: {noise['recording']:.2f} counts in the recording, {noise['twin']:.2f} in the twin.")
    if summary["frechet_db"]:
        page.text(
            "Fréchet distance of the maps' patches: similarity as sets, independent of the place shown. For scale, the "
            "distance between the recording's two halves.",
        )
        distances = summary["frechet_db"].items()
        halves = [(n.replace("_", " "), text(d["twin"]), text(d["own_halves"])) for n, d in distances]
        page.table(("map", "twin, dB", "own halves, dB"), halves, numbers=(1, 2))


def _alignment(page: Page, found: Comparison) -> None:
    if not found.alignment:
        return
    page.section(
        "Alignment",
        "Mean correlation of range-azimuth maps over shifts of the twin. A peak away from zero indicates wrong time "
        "stamps, poses or scene, which makes other figures unreliable; no peak at all indicates a different place.",
    )
    figure = make_subplots(rows=1, cols=len(found.alignment))
    for column, (name, (shifts, values)) in enumerate(found.alignment.items(), 1):
        unit, factor, _ = _SHIFTED[name]
        x, y = np.round(factor * shifts, 4).tolist(), np.round(values, 4).tolist()
        figure.add_scatter(x=x, y=y, line={"color": COLORS["slam"]}, showlegend=False, row=1, col=column)
        figure.add_vline(x=0, line={"color": INK, "dash": "dot", "width": 1}, row=1, col=column)
        figure.update_xaxes(title=f"{name}, {unit}", row=1, col=column)
    figure.update_yaxes(title="correlation", col=1)
    page.plot(figure, height=300)


def _profiles(page: Page, found: Comparison) -> None:
    page.section("Range profiles", "Power over range, summed over antennas and velocities; dB re strongest echo.")
    shown = np.unique(np.linspace(0, len(found.frames) - 1, _PROFILES).astype(int))
    if len(shown) > 1:
        figure, axes = canvas(2, height=3.0)
        for axis, (who, _), power in zip(axes[0], _WHO, found.profiles.swapaxes(0, 1), strict=False):
            draw_profiles(axis, found.times[shown], found.ranges, power[shown])
            axis.set_title(who)
        page.picture(figure, "Range profiles over time")
    figure = panels("mean level, dB re 1 count²", x="range, m")
    for (who, color), power in zip(_WHO, found.profiles.swapaxes(0, 1), strict=False):
        line(figure, (found.ranges, 10 * np.log10(np.maximum(power, 1e-9)).mean(axis=0)), who, color)
    page.plot(figure, height=340)


def _frames(page: Page, found: Comparison, one: Recording, other: Recording) -> None:
    page.section(
        "Heat maps and scans",
        "The frames with the best, the median and the worst correlation. Rings: the scan extracted from the map; dots: "
        "the surfaces of the scene, in both.",
    )
    rank = np.argsort(np.nan_to_num(found.figures["correlation_range_azimuth"], nan=-1))
    maps = Heatmaps(found.config)
    reach = _reach(found)
    for k in dict.fromkeys((rank[-1], rank[len(rank) // 2], rank[0])):
        figure, axes = canvas(2, rows=2, height=3.0)
        for who, source in enumerate((one, other)):
            frame = found.frames[k, who]
            spectrum = maps.spectrum(source.adc(frame, frame + 1), source.valid(frame, frame + 1))
            name = _WHO[who][0]
            axis = axes[0, who]
            draw_fan(axis, maps.range_azimuth_of(spectrum, "capon")[0].numpy(), maps.ranges, maps.azimuths, name, reach)
            if other.has("truth/scan"):
                scene = other.rows("truth/scan", *(found.frames[k, 1] + [0, 1]))[0]
                draw_scan(axis, other.read("truth/scan_azimuths"), scene, "truth", "scene")
            draw_scan(axis, BEARINGS, found.scans[k, who], "measured", "scan")
            velocity = found.velocity[k, 2]
            speeds = maps.doppler_azimuth_of(spectrum)[0].numpy()
            draw_doppler(axes[1, who], speeds, maps.velocities, maps.azimuths, name, velocity)
        value = found.figures["correlation_range_azimuth"][k]
        page.picture(figure, f"Frame {found.frames[k, 0]}, {found.times[k]:.2f} s, correlation {value:.2f}")


def _reach(found: Comparison) -> float:
    """Range within which nearly all scans end, m; the full range if there are none."""
    ends = found.scans[np.isfinite(found.scans)]
    return float(min(1.3 * np.quantile(ends, 0.98) + 0.5, found.ranges[-1])) if len(ends) else float(found.ranges[-1])


def _velocities(page: Page, found: Comparison) -> None:
    page.section("Velocity", "From single frames, by Doppler least squares.")
    figure = panels("forward, m/s", "left, m/s")
    for k, (who, color) in enumerate(_WHO):
        for axis in range(2):
            line(figure, (found.times, found.velocity[:, k, axis]), who, color, 1.3, row=axis + 1)
    page.plot(figure, height=420)


def _over_time(page: Page, found: Comparison) -> None:
    shown = [n for n in FIGURES if n in found.figures and np.isfinite(found.figures[n]).any()]
    if len(found.times) < 2 or not shown:
        return
    page.section("Figures over time", "Click a name to show or hide it.")
    figure = panels("")
    default = ("correlation_range_azimuth", "correlation_doppler_azimuth", "profile_correlation")
    for name, color in zip(shown, cycle(qualitative.Plotly)):
        visible = True if name in default else "legendonly"
        line(figure, (found.times, found.figures[name]), name.replace("_", " "), color, 1.2, visible=visible)
    page.plot(figure, height=420)
