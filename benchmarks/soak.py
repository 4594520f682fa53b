"""Sessions that go on and on: `radarize live` at the virtual radar over a bad network, and a day of SLAM at a blow."""

import argparse
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from pathlib import Path

import numpy as np
import psutil

from benchmarks.capture_speed import chirps_that_arrive, compared
from benchmarks.results import Data, Page, memory_mb, same, script, surroundings
from radarize.io.pose import between, compose
from radarize.io.recording import Recording
from radarize.radar.dca1000 import MAX_PAYLOAD
from radarize.radar.presets import PRESETS
from radarize.signal.bearings import BEARINGS
from radarize.slam.backend import Slam
from radarize.slam.config import SlamConfig
from radarsim.emulator.disturbance import Disturbance
from radarsim.recording.simulate import simulate
from tests.disk import disk, fill
from tests.slam.world import box, scan, walk
from tests.virtual import BOARD, COMPUTER, emulator

NETWORK = {"loss": 0.01, "duplicate": 0.01, "reorder": 0.01}
#: s of the walk that is played again and again; s between looks at memory; share of a session that warms up.
WALK, LOOK, WARM = 5.0, 1.0, 0.2
#: s between a disk that fills and the next time that it does, and how long it stays full; kiB of it for a frame.
FULL_EVERY, FULL_FOR, ROOM_FOR_A_FRAME = 120.0, 3.0, 400
#: A room, m, and a way through it that is walked for so many s of each hour, scans coming at so many Hz.
ROOM = np.concatenate([box(0, 0, 8, 6), box(3, 2.5, 3.6, 3.1), box(7, 0, 8, 0.6), box(0, 5, 0.5, 6)])
ROUND, WALKED, RATE = [[1, 1], [6, 1], [6, 4.5], [1, 4.5], [1, 1]], 60.0, 5.0


def pester(port: int, ended: threading.Event, counts: dict[str, int]) -> None:
    """Packets from the board's address that are not the board's: of the right form, and garbage."""
    rng = np.random.default_rng(0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind((BOARD, 0))
        while not ended.wait(0.05):
            header = int(rng.integers(2**32)).to_bytes(4, "little") + int(rng.integers(2**48)).to_bytes(6, "little")
            stranger.sendto(header + rng.bytes(int(rng.integers(MAX_PAYLOAD))), (COMPUTER, port))
            counts["forged"] += 1


def look_on(url: str, ended: threading.Event, counts: dict[str, int]) -> None:
    """A browser that comes, takes events for a while, and goes."""
    while not ended.wait(1.0):
        try:
            with urllib.request.urlopen(url) as page, urllib.request.urlopen(url + "events") as events:
                page.read()
                leave = time.monotonic() + 3.0
                while time.monotonic() < leave and events.read1(1 << 16):
                    pass
        except OSError:  # the session has ended
            return
        counts["visits"] += 1


def crowd_out(place: Path, ended: threading.Event, counts: dict[str, int]) -> None:
    """Somebody whose files fill a disk now and then."""
    while not ended.wait(FULL_EVERY):
        fill(place / "large")
        counts["full"] += 1
        ended.wait(FULL_FOR)
        (place / "large").unlink()


def live(minutes: float, folder: Path, seed: int) -> tuple[dict[str, object], str]:
    """A session at the virtual radar: a row of the table, and what its recording warns of."""
    frames = round(60 * minutes / PRESETS["radarize"].frame_period)
    room = (64 << 10) + frames * ROOM_FOR_A_FRAME
    with disk(folder / "recorded", room, folder / "image.ext4") as place:
        return _live(frames, folder, place / "live.h5", seed)


def _live(frames: int, folder: Path, output: Path, seed: int) -> tuple[dict[str, object], str]:
    simulate("office", folder / "walk.h5", duration=WALK, seed=seed)
    with Recording(folder / "walk.h5") as source:
        config, played = source.config, source.adc(0, len(source))
    ended, counts, memory = threading.Event(), {"forged": 0, "visits": 0, "full": 0}, []
    options = [word for name, share in NETWORK.items() for word in (f"--{name}", str(share))]
    with emulator(folder / "walk.h5", folder, "--loop", *options, "--seed", seed) as board:
        time.sleep(3)  # frames are made ahead
        command = [
            sys.executable, "-m", "radarize.cli", "live", "--config", "radarize", *board.options, "--frames", frames,
            "--odometry", "doppler", "--scans", "first-echo", "--address", "127.0.0.1:0", "-o", output,
        ]  # fmt: skip
        with subprocess.Popen([*map(str, command)], stdout=subprocess.PIPE, text=True) as session:
            url = re.match(r"page: (\S+)", session.stdout.readline())[1]
            guests = [
                threading.Thread(target=pester, args=(board.data_port, ended, counts)),
                threading.Thread(target=look_on, args=(url, ended, counts)),
                threading.Thread(target=crowd_out, args=(output.parent, ended, counts)),
            ]
            for guest in guests:
                guest.start()
            process = psutil.Process(session.pid)
            while session.poll() is None:
                memory.append(1e-6 * sum(p.memory_info().rss for p in (process, *process.children())))
                time.sleep(LOOK)
            ended.set()
            for guest in guests:
                guest.join()
    arriving = chirps_that_arrive(config, frames, Disturbance(**NETWORK, rng=np.random.default_rng(seed)))
    losses, mismarked, wrong, warnings = compared(output, played, arriving)
    memory = np.array(memory[:-2])  # while it ends, the graph is optimised
    return {
        "case": f"live, {frames * config.frame_period / 60:.3g} min, " + " ".join(options),
        "exit code": session.returncode,
        "frames": frames,
        "frames not written": frames - losses.frames,
        "chirps lost": losses.lost_chirps,
        "lost but not marked, or marked but not lost": mismarked,
        "chirps with a wrong sample": wrong,
        "forged packets": counts["forged"],
        "visits of a browser": counts["visits"],
        "times the disk was full": counts["full"],
        "MB after warm-up": float(memory[int(WARM * len(memory))]),
        "MB at the end": float(memory[-1]),
        "MB at most": float(memory.max()),
    }, warnings


def day(hours: float, seed: int) -> dict[str, object]:
    """SLAM without end, as fast as it goes: standing, with a minute's walk in the same room every hour."""
    slam, rng = Slam(SlamConfig.preset("radar"), endless=True), np.random.default_rng(seed)
    steps = walk(ROUND, 0.5 / RATE, 0.5 / RATE)
    ways, frames = np.concatenate([steps, steps[::-1]]), round(3600 * hours * RATE)
    hour, walked = round(3600 * RATE), round(WALKED * RATE)
    true = odometry = ways[0]
    seen, memory, place = scan(ROOM, true, BEARINGS, 4.28), [memory_mb()], 0
    for k in range(frames):
        step = np.zeros(3)
        if k % hour < walked:
            place += 1
            there = ways[place % len(ways)]
            step, true = between(true, there), there
            seen = scan(ROOM, true, BEARINGS, 4.28)
        sigma = 0.03 * np.abs(step) + 1e-5
        odometry = compose(odometry, step + rng.normal(0, sigma))
        slam.add_odometry(k / RATE, odometry, np.diag(sigma**2))
        slam.add_scan(k / RATE, BEARINGS, seen + rng.normal(0, 0.03, len(seen)))
        if k % hour == hour - 1 or k == frames - 1:
            memory.append(memory_mb())
    now = compose(slam.graph.poses[-1], between(slam.odometry.pose(slam.nodes[-1].time), odometry))
    return {
        "case": f"SLAM at a blow, {hours:g} h of standing, {WALKED:g} s of walking in each",
        "frames": frames,
        "nodes kept": len(slam.nodes),
        "place off by, m": float(np.hypot(*(now - true)[:2])),
        "odometry off by, m": float(np.hypot(*(odometry - true)[:2])),
        "MB after warm-up": memory[min(1 + int(WARM * len(memory)), len(memory) - 1)],
        "MB at the end": float(memory[-1]),
        "MB at most": max(memory),
    }


@script(
    "Sessions that go on and on",
    minutes=(60.0, "of the live session; 0: none"),
    hours=(24.0, "of the day; 0: none"),
    seed=(0, "of walk, network and noise"),
)
def main(options: argparse.Namespace) -> Page:
    """The table."""
    rows = []
    notes = [
        f"Live: {WALK:g} s of a simulated office again and again, its jump back included; every sample compared with "
        "the one sent, and every chirp's mark with what the network's seed says was lost. Forged packets come from the "
        "board's address and another port; a browser takes events for 3 s and goes.",
        f"Memory is resident, of the session and the process that receives; warm after {WARM:.0%} of a row's time. "
        f"The day's scans come at {RATE:g} Hz.",
        f"Every {FULL_EVERY:g} s something else takes all room on the recording's disk, for {FULL_FOR:g} s; frames of "
        "that time are not written, and counted.",
        surroundings(),
    ]
    if options.minutes:
        with tempfile.TemporaryDirectory() as folder:
            row, warnings = live(options.minutes, Path(folder), options.seed)
        rows.append(row)
        notes += [f"Live: {warnings}."] if warnings else []
    if options.hours:
        rows.append(day(options.hours, options.seed))
    data = Data("a simulated office, played by `radarsim emulate`, and a room of walls", (), options.seed)
    return Page(same(rows), data=data, notes=notes)
