"""Speed of `radarize live`: dropped frames and run time per frame, on a replay in real time with a client on its page,
and with the virtual radar, recording, and a browser on one machine.

Wall time shows whether this machine keeps up with its other load; processor time is the load on an idle machine.
"""

import argparse
import re
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from dataclasses import asdict
from pathlib import Path

import psutil

from benchmarks.results import Data, Page, same, script, surroundings
from radarize.capture.live import Live, prepare
from radarize.capture.page import LivePage
from radarize.capture.replay import Replay
from radarize.evaluation.benchmark.networks import Networks
from radarize.evaluation.benchmark.runs import Pair
from radarize.io.recording import Losses, Recording
from radarize.io.stopwatch import Stopwatch
from radarize.pipeline.method import Inputs
from radarize.pipeline.methods import CLASSICAL, best_methods, pace
from radarsim.recording.simulate import simulate
from tests.capture.browser import Browser
from tests.virtual import emulator


def look_on(url: str) -> None:
    """Read the events of the page as a browser does, until they end."""
    with urllib.request.urlopen(url + "events") as events:
        while events.read1(1 << 16):
            pass


def measure(path: Path, methods: dict[str, str]) -> dict[str, object]:
    """Run one replay; return a row of the table."""
    stream = Replay(path)
    every = pace(methods["odometry"], stream.config)
    inputs, watch = prepare(Inputs(stream.config, every=every), methods), Stopwatch()
    with LivePage("127.0.0.1:0") as page, stream:
        viewer = threading.Thread(target=look_on, args=(page.url,), daemon=True)
        viewer.start()
        (reader,) = [p for p in psutil.Process().children() if "spawn_main" in " ".join(p.cmdline())]
        live, last, instants = Live(inputs, methods, page), [0.0], []

        def note(done: int, total: int) -> None:
            instants.append((time.monotonic(), done))
            if reader.is_running():
                used = reader.cpu_times()
                last[0] = used.user + used.system

        start = time.process_time()
        note(0, 0)
        reading = last[0]
        with watch.running():
            list(live.follow(stream, threading.Event(), progress=note))
        used = time.process_time() - start
    (began, first), (ended, final) = instants[1], instants[-1]
    frames, counts = max(live.losses.frames, 1), stream.counts
    return {
        "odometry, scans": f"{methods['odometry']}, {methods['scans']}",
        "follows": _follows(every),
        "frames/s": (final - first) / (ended - began),
        "dropped": f"{counts.dropped} of {counts.frames}",
        "ms a frame": 1e3 * live.busy / frames,
        "processor ms a frame": 1e3 * used / frames,
        "of it the page": 1e3 * watch.seconds["page"] / frames,
        "reading process": 1e3 * (last[0] - reading) / counts.frames,
        "budget, ms": 1e3 * stream.config.frame_period,
    }


def together(path: Path, frames: int, folder: Path) -> dict[str, object]:
    """Run a session with the virtual radar, which repeats a recording; return a row of the table."""
    output, config = folder / "live.h5", Replay(path).config
    (best, _), losses = best_methods(config), Losses(config.frame_period)
    with emulator(path, folder, "--loop") as board:
        time.sleep(3)  # frames are made ahead
        command = [
            sys.executable, "-m", "radarize.cli", "live", "--config", "radarize", *board.options, "--frames", frames,
            "--address", "127.0.0.1:0", "-o", output,
        ]  # fmt: skip
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        with subprocess.Popen([*map(str, command)], text=True, **streams) as session:
            url = re.match(r"page: (\S+)", session.stdout.readline())[1]
            with Browser(url, folder / "profile"):
                printed, warnings = session.communicate()
    with Recording(output) as recording:
        for where, _ in recording.batches(64):
            losses.add(recording.valid(where.start, where.stop), recording.times[where])
    dropped = re.search(r"(\d+) of \d+ frames were dropped", warnings)
    return {
        "odometry, scans": f"{best['odometry']}, {best['scans']}, all together",
        "follows": _follows(pace(best["odometry"], config)),
        "dropped": f"{dropped[1] if dropped else 0} of {frames}",
        "not recorded": frames - losses.frames,
        "chirps lost": losses.lost_chirps,
        "ms a frame": float(re.search(r"frames, (\S+) ms each", printed)[1]),
        "budget, ms": 1e3 * config.frame_period,
    }


def _follows(every: int) -> str:
    return "all frames" if every == 1 else f"one of {every}"


@script(
    "radarize live in real time, preset radarize",
    duration=(20.0, "duration of the simulated recording, s"),
    frames=(9000, "frames of the session with the virtual radar; 0: none"),
    seed=(0, "seed of the simulated recording"),
    recording=(Path, "recording; by default one is simulated", {"nargs": "?"}),
)
def main(options: argparse.Namespace) -> Page:
    with tempfile.TemporaryDirectory() as folder:
        path = options.recording or simulate(
            "office", Path(folder) / "office.h5", duration=options.duration, seed=options.seed
        )
        chosen = dict.fromkeys((Pair(**CLASSICAL), Pair(**best_methods(Replay(path).config)[0])))
        rows = [measure(path, asdict(pair)) for pair in chosen]
        data = Data.of(path.stem, [path], options.seed)
        if options.frames:
            rows.append(together(path, options.frames, Path(folder)))
    return Page(
        same(rows),
        data=data,
        networks=Networks().used([kind for pair in chosen for kind in pair.networks]),
        notes=[
            "A client reads the events of the page. dropped: frames that were left out because this machine was too "
            "slow; processor ms per frame: of the main process.",
            "all together: `radarsim emulate` repeats the recording over UDP, `live` estimates and records, and "
            "headless Chromium shows its page.",
            surroundings(),
        ],
    )
