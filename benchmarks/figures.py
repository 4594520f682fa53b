"""Figures in README and docs, taken from the parts of the pages: `python -m benchmarks.figures` writes them anew.

A figure is enclosed by two comments; `FIGURES` has the functions that write them:

    On test walks the mean error is <!-- figures: walks-mean -->0.13 and 0.034 m<!-- end -->.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.results import PARTS
from radarize.evaluation.benchmark.results import Results

ROOT = Path(__file__).parents[1]
_MARKED = re.compile(r"(<!-- figures: ([\w-]+) -->).*?(<!-- end -->)", re.DOTALL)
#: RadarHD's test walks by place.
PLACES = ((117, 132), (227, 230, 233, 237, 242), (248, 250))
METHODS = {
    "cfar": "CFAR",
    "network": "our network, from simulation alone",
    "radarhd-simulated": "RadarHD's network, width 8, 43 minutes of training, from simulation alone",
    "RadarHD": "RadarHD, from 25 real walks",
}
#: Public lidar logs.
LOGS = ("intel", "csail", "orebro")
#: Scans that the page of results shows.
EXTRACTORS = ("segmentation", "first-echo", "cfar", "radarhd")
#: Odometry and scans whose run time the page of sizes and times shows.
RUNS = (("fused", "segmentation"), ("doppler", "first-echo"))
Row = Mapping[str, Any]


def rows(part: str, title: str = "") -> list[Row]:
    """Of a part's first table whose title ends so."""
    tables = Results.read(PARTS / f"{part}.json").tables
    return next(table.rows for table in tables if table.title.lower().endswith(title))


def table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """As Markdown."""
    return "\n".join("| " + " | ".join(line) + " |" for line in (head, ["---"] * len(head), *lines))


def walks() -> str:
    """Errors by platform, and of the worst walk."""
    means, each = {row["on"]: row for row in rows("walks", "by platform and building")}, rows("walks", "walk by walk")
    lines = []
    for words, kind in (("odometry", "odometry"), ("SLAM", "SLAM")):
        found = [means[on][f"{kind} m"] for on in ("handheld", "cart", "robot", "all")]
        lines.append([words, *found, f"{max(row[f'{kind} m'] for row in each):.2f}"])
    return table(["mean error, m", "handheld", "cart", "robot", "all", "worst walk"], lines)


def _on(part: str, group: str = "all") -> Row:
    return next(row for row in rows(part, "by platform and building") if row["on"] == group)


def _default_scans(part: str, group: str = "all") -> Row:
    column = "on" if part == "mapping" else "levels"
    return next(row for row in rows(part) if row["scans"] == "segmentation" and row[column] == group)


def _chosen(radar: str) -> Row:
    return next(row for row in rows("radars") if row["chosen"] and row["radar"].startswith(radar))


def mean_errors(part: str) -> tuple[str, str]:
    """Mean ATE of odometry and of SLAM over all walks of a part, m."""
    mean = _on(part)
    odometry, slam = (float(mean[f"{kind} m"].split()[0]) for kind in ("odometry", "SLAM"))
    return f"{odometry:.2f} m", f"{slam:.3f} m"


def release(part: str) -> str:
    """Version of this project that a part was made with."""
    return str(Results.read(PARTS / f"{part}.json").machine["version"])


def chamfer(method: str, place: Sequence[int], way: str = "instant_") -> float:
    """Mean distance of a method's points from the lidar's on some real walks, m."""
    found = [row for row in rows("real", "real walks") if row["method"] == method and row["walk"] in place]
    return float(sum(row[f"{way}chamfer_m"] for row in found) / len(place))


def readme() -> str:
    """The five results of README: what, simulated or real, the result, the release, the page."""

    def page(name: str, part: str, *cells: str) -> list[str]:
        return [*cells, release(part), f"[{name}](benchmarks/results/{name}.md)"]

    chosen, pair = _chosen("radarize"), ("doppler", "first-echo")
    same_radar = [row for row in rows("radars") if row["radar"] == chosen["radar"]]
    without = next(row for row in same_radar if (row["odometry by"], row["scans"]) == pair)
    plain, networks = ([str(row[f"{kind} m"]).split()[0] for kind in ("odometry", "SLAM")] for row in (without, chosen))
    scan = _default_scans("mapping")
    live = next(row for row in rows("live_speed") if row["odometry, scans"] == "fused, segmentation")
    (minute, minute_slam), number = mean_errors("walks"), sum(1 for _ in rows("walks", "walk by walk"))
    lines = [
        page("walks", "walks", f"Mean ATE, {number} walks of 1 min", "simulated",
             f"odometry {minute}, SLAM {minute_slam}"),
        page("radars", "radars", f"Mean ATE without networks (with), {without['walks']} shorter walks", "simulated",
             f"odometry {plain[0]} m ({networks[0]} m), SLAM {plain[1]} m ({networks[1]} m)"),
        page("scans", "mapping", f"Ranges within 10 cm, F1 of the map, {scan['recordings']} walks", "simulated",
             f"{scan['within 10 cm %']:.0f} %, {scan['map F1 %']:.0f} %"),
        page("real", "real", "Distance of points from a lidar's, building new to both networks", "**real** pictures",
             f"{chamfer('network', PLACES[1]):.2f} m; RadarHD {chamfer('RadarHD', PLACES[1]):.2f} m"),
        page("speed", "live_speed", "Time per frame on 2 cores, frames every 33 ms", "simulated",
             f"{live['ms a frame']:.0f} ms"),
    ]  # fmt: skip
    return table(["what", "data", "result", "release", "page"], lines)


def walks_mean() -> str:
    """Of odometry and of SLAM over all walks."""
    odometry, slam = mean_errors("walks")
    return f"{odometry} and {slam}"


def heading_nees() -> str:
    """NEES of odometry's motion over 1, 10 and 50 s by platform."""

    def listed(row: Row) -> str:
        first, second, third = (str(row[f"NEES pose {span} s (median)"]).split()[0] for span in (1, 10, 50))
        return f"{first}, {second} and {third}"

    return ", ".join(f"{listed(_on('walks', name))} ({name})" for name in ("handheld", "cart", "robot"))


def long_walks_mean() -> str:
    """The same over walks of five minutes."""
    odometry, slam = mean_errors("long_walks")
    return f"{odometry} and {slam}"


def clock_gap() -> str:
    """Largest difference of the clocks of radar and lidar on real test walks."""
    gaps = [abs(row[key]) for row in rows("real", "clocks") for key in ("start_s", "end_s") if row[key] is not None]
    return f"{max(gaps):.1f} s"


def live_time() -> str:
    """Mean run time of `radarize live` with networks per frame received, and the time between frames."""
    row = next(row for row in rows("live_speed") if row["odometry, scans"] == "fused, segmentation")
    return f"{row['ms a frame']:.0f} ms of the {row['budget, ms']:.0f} ms between frames"


def live_dropped() -> str:
    """Frames that `radarize live` dropped in the session of an hour."""
    notes = " ".join(note for each in Results.read(PARTS / "soak.json").tables for note in each.notes)
    dropped, frames = map(int, re.search(r"(\d+) of (\d+) frames were dropped", notes).groups())
    return f"{dropped:,} of {frames:,} frames ({100 * dropped / frames:.1f} %)"


def sizes() -> str:
    """What a minute takes on the disk, and how long it takes to make."""
    frames, found = 1800, {str(row["what"]): row for row in rows("dataset_speed")}
    raw, maps = (next(row for what, row in found.items() if what.startswith("2 workers") and what.endswith(kind))
                 for kind in ("thread, raw", "heatmaps"))  # fmt: skip
    speed = frame_times()
    one, two = (speed[f"office: {way}"] for way in ("radarsim", "a recording by 2 processes"))
    lines = [
        ["recording with all sensors, samples", f"{raw['kB per frame'] * frames / 1e3:.0f} MB", "-"],
        ["the same as heat maps (`storage: heatmaps`)", f"{maps['kB per frame'] * frames / 1e3:.0f} MB", "-"],
        ["simulating the office, radar alone, 1 process", "-", f"{one * frames / 1e3:.0f} s"],
        ["simulating the office, radar alone, 2 processes", "-", f"{two * frames / 1e3:.0f} s"],
        ["data set with all sensors, 2 processes", "-", f"{raw['ms per frame'] * frames / 1e3:.0f} s"],
        *(
            [f"`radarize run`, {row['odometry']} and {row['scans']}", "-",
             f"{row['whole, with reading'] * frames / 1e3:.0f} s"]
            for row in rows("runtime") if (row["odometry"], row["scans"]) in RUNS
        ),
    ]  # fmt: skip
    return table(["a minute (1,800 frames)", "disk", "time on 2 cores"], lines)


def heatmap_share() -> str:
    """Size of a recording of heat maps as a share of one of samples."""
    found = {str(row["what"]): row["kB per frame"] for row in rows("dataset_speed")}
    return f"{100 * found['2 workers x 1 thread, heatmaps'] / found['2 workers x 1 thread, raw']:.0f} %"


def frame_times() -> dict[str, float]:
    """Times per frame of the simulator by scene and way, ms."""
    return {row["way"]: row["ms per frame"] for row in rows("simulator_speed")}


def simulator() -> str:
    """Time per frame of the simulator and of Sionna RT on one scene."""
    speed = frame_times()
    ours, theirs = speed["office: radarsim"], speed["office: paths of Sionna RT"] / 1e3
    return f"{ours:.0f} ms on one core; the paths of Sionna RT take {theirs:.1f} s"


def scans() -> str:
    """Scans and maps by method, and at the worst level of the multipath test."""
    head = {"within 10 cm %": 1, "returned %": 1, "ghosts left %": 1, "map F1 %": 1, "SLAM ATE m": 3}
    worst = {"ghosts, % of returns": 1, "map F1, %": 1, "SLAM ATE, m": 3}
    plain, severe = (
        {row["scans"]: row for row in rows(part) if row[column] == level}
        for part, column, level in (("mapping", "on", "all"), ("multipath", "levels", "most severe"))
    )
    lines = [
        [
            extractor,
            *(f"{plain[extractor][name]:.{digits}f}" for name, digits in head.items()),
            *(f"{severe[extractor][name]:.{digits}f}" for name, digits in worst.items()),
        ]
        for extractor in EXTRACTORS
    ]
    names = [f"{name[:-2]}, {name[-1]}" if name[-2] == " " else name for name in head]
    return table(["scans by", *names, *(f"worst level: {name}" for name in worst)], lines)


def ranges() -> str:
    """Accuracy and share of the ranges that the network returns."""
    found = _default_scans("mapping")
    near, returned = (f"{found[f'{name} %']:.0f} %" for name in ("within 10 cm", "returned"))
    return f"{near} of ranges are within 10 cm, and {returned} of surfaces have a range"


def conditions() -> str:
    """Plain walks, and the conditions under which SLAM errs at least twice as much."""
    times = "times the plain walks'"
    shown = [row for row in rows("conditions") if row["condition"] == "plain" or row[times] >= 2]
    lines = [
        [re.sub(r"^phases \w+ by", "phase errors of", name), row["odometry m"], row["SLAM m"], f"{row[times]:.1f}"]
        for name, row in ((str(row["condition"]), row) for row in shown)
    ]
    return table(["condition", "odometry, m", "SLAM, m", times], lines)


def radars() -> str:
    """Each radar without networks, and with what is chosen for it."""
    found, lines = rows("radars"), []
    for radar in dict.fromkeys(row["radar"] for row in found):
        without = next(row for row in found if row["radar"] == radar and row["scans"] == "first-echo")
        chosen = next(row for row in found if row["radar"] == radar and row["chosen"])
        maps = [f"{row['map F1 %']:.0f}" for row in (without, chosen)]
        lines.append([radar, without["SLAM m"], chosen["SLAM m"], *maps])
    return table(["radar", "SLAM without networks, m", "SLAM, m", "map F1 without, %", "map F1, %"], lines)


def real() -> str:
    """Distances of points on real walks matched by time, and in brackets matched by frame index."""
    lines = []
    for method, words in METHODS.items():
        cells = []
        for place in PLACES:
            by = [chamfer(method, place, way) for way in ("instant_", "")]
            cells.append(f"{by[0]:.2f} ({by[1]:.2f})")
        lines.append([words, *cells])
    return table(["", "building of RadarHD's training", "another building", "standing still"], lines)


def realism() -> str:
    """Return the shares of pictures that a network classifies correctly as real or simulated."""
    shares = rows("realism")[:2]  # the rows of the discriminator: single pictures, pairs
    return " and ".join(f"{row['furnished']:.0f} % of {words}" for row, words in zip(
        shares, ("single pictures", "pairs"), strict=True))  # fmt: skip


def back_end() -> str:
    """ATE on lidar logs, with Cartographer's in brackets."""
    logs = [row for row in rows("slam_backend") if row["case"] in [f"lidar, {log}" for log in LOGS]]
    found = (f"{row['ATE m']:.3f} ({row['to beat'].split(' m')[0]})" for row in logs)
    return f"{', '.join(found)} m on {', '.join(LOGS)}"


#: Headline figures: what, the value of release 1.0.0 in bare rooms, and the present value.
HEADLINES: tuple[tuple[str, str, Callable[[], str]], ...] = (
    ("odometry, mean ATE", "0.130 m, 0.023 rad", lambda: _walks("odometry")),
    ("odometry, mean ATE, handheld", "0.223 m, 0.033 rad", lambda: _walks("odometry", "handheld")),
    ("SLAM, mean ATE", "0.034 m, 0.011 rad", lambda: _walks("SLAM")),
    ("SLAM, worst walk", "0.230 m", lambda: f"{_on('walks')['worst SLAM m']:.3f} m"),
    ("F1 of the map", "87.5 %", lambda: f"{_on('walks')['map F1 %']:.1f} %"),
    ("SLAM, walks of five minutes", "0.027 m", lambda: mean_errors("long_walks")[1]),
    ("ranges within 10 cm", "89.9 %", lambda: f"{_default_scans('mapping')['within 10 cm %']:.1f} %"),
    ("ghosts at the worst level of the multipath test", "4.6 % of returns",
     lambda: f"{_default_scans('multipath', 'most severe')['ghosts, % of returns']:.1f} % of returns"),
    ("SLAM with the IWR6843AOP", "0.065 m", lambda: f"{_chosen('60 GHz, antennas')['SLAM m'].split()[0]} m"),
    ("simulating a frame of the office, one core", "25.9 ms",
     lambda: f"{frame_times()['office: radarsim']:.1f} ms"),
)  # fmt: skip


def _walks(kind: str, group: str = "all") -> str:
    row = _on("walks", group)
    return f"{row[f'{kind} m'].split()[0]} m, {row[f'{kind} rad']:.3f} rad"


def headlines() -> str:
    """Headline figures of release 1.0.0 and now."""
    lines = [[what, old, now()] for what, old, now in HEADLINES]
    return table(["", "1.0.0, bare rooms", "now, furnished rooms"], lines)


#: Figures by name.
FIGURES: dict[str, Callable[[], str]] = {
    "readme": readme, "walks": walks, "walks-mean": walks_mean, "heading-nees": heading_nees,
    "long-walks-mean": long_walks_mean, "scans": scans, "conditions": conditions, "radars": radars, "real": real,
    "realism": realism, "back-end": back_end, "clock-gap": clock_gap, "live-time": live_time,
    "live-dropped": live_dropped, "headlines": headlines, "sizes": sizes, "heatmap-share": heatmap_share,
    "simulator": simulator, "ranges": ranges,
}  # fmt: skip


def written(text: str) -> str:
    """A page with its figures as they are now.

    Raises:
        KeyError: a figure that is none.
    """

    def anew(found: re.Match[str]) -> str:
        figure = FIGURES[found[2]]()
        around = "\n\n" if "\n" in figure else ""  # a table is a paragraph of its own
        return found[1] + around + figure + around + found[3]

    return _MARKED.sub(anew, text)


def pages() -> list[Path]:
    """That have figures."""
    texts = (ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md")))
    return [page for page in texts if "<!-- figures: " in page.read_text()]


def main() -> None:
    for page in pages():
        page.write_text(written(page.read_text()))
        print(page.relative_to(ROOT))


if __name__ == "__main__":
    main()
