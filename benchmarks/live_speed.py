"""`radarize live` on a replay in real time, somebody looking on: frames dropped, and what a frame costs.

Wall time says whether this machine keeps up with whatever else it does; processor time what it takes of a free one.
"""

import tempfile
import threading
import time
import urllib.request
from pathlib import Path

import psutil

from benchmarks.results import Data, command_line, publish, surroundings
from radarize.benchmark.networks import Networks
from radarize.benchmark.runs import Pair
from radarize.capture.live import Live, prepare
from radarize.capture.page import Page
from radarize.capture.replay import Replay
from radarize.methods.registry import CLASSICAL, Inputs, best_methods, pace
from radarize.stopwatch import Stopwatch
from radarsim.simulate import simulate


def look_on(url: str) -> None:
    """Take events as a browser does, until they end."""
    with urllib.request.urlopen(url + "events") as events:
        while events.read1(1 << 16):
            pass


def measure(path: Path, methods: dict[str, str]) -> dict[str, object]:
    """One replay; a row of the table."""
    stream = Replay(path)
    every = pace(methods["odometry"], stream.config)
    inputs, watch = prepare(Inputs(stream.config.every(every)), methods), Stopwatch()
    with Page("127.0.0.1:0") as page, stream:
        viewer = threading.Thread(target=look_on, args=(page.url,), daemon=True)
        viewer.start()
        (reader,) = [p for p in psutil.Process().children() if "spawn_main" in " ".join(p.cmdline())]
        live, last, instants = Live(inputs, methods, page, every=every), [0.0], []

        def note(done: int, total: int) -> None:
            instants.append((time.monotonic(), done))
            if reader.is_running():
                used = reader.cpu_times()
                last[0] = used.user + used.system

        start = time.process_time()
        note(0, 0)
        reading = last[0]
        with watch.running():
            live.run(stream, threading.Event(), progress=note)
        used = time.process_time() - start
    (began, first), (ended, final) = instants[1], instants[-1]
    frames, counts = max(live.losses.frames, 1), stream.counts
    return {
        "odometry, scans": f"{methods['odometry']}, {methods['scans']}",
        "follows": "all frames" if every == 1 else f"one of {every}",
        "frames/s": (final - first) / (ended - began),
        "dropped": f"{counts.dropped} of {counts.frames}",
        "ms a frame": 1e3 * live.busy / frames,
        "processor ms a frame": 1e3 * used / frames,
        "of it the page": 1e3 * watch.seconds["page"] / frames,
        "reading process": 1e3 * (last[0] - reading) / counts.frames,
        "budget, ms": 1e3 * stream.config.frame_period,
    }


PARSER = command_line(
    __doc__,
    duration=(20.0, "of the simulated recording, s"),
    seed=(0, "of it"),
)
PARSER.add_argument("recording", nargs="?", type=Path, help="a recording; by default one is simulated")


def main() -> None:
    options = PARSER.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = options.recording or simulate(
            "office", Path(folder) / "office.h5", duration=options.duration, seed=options.seed
        )
        chosen = dict.fromkeys((Pair(**CLASSICAL), Pair(**best_methods(Replay(path).config)[0])))
        rows = [measure(path, {"odometry": pair.odometry, "scans": pair.scans}) for pair in chosen]
        data = Data.of(path.stem, [path], options.seed)
    publish(
        "live_speed",
        "radarize live on a replay in real time, preset radarize",
        rows,
        data=data,
        networks=Networks().used([kind for pair in chosen for kind in pair.networks]),
        notes=[
            "A browser's stream of events is read all the time. Dropped frames are whole ones that found no room "
            "because this machine was too slow for them; processor time is that of the main process.",
            surroundings(),
        ],
    )


if __name__ == "__main__":
    main()
