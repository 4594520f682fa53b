"""Long sessions: `radarize live` with the virtual radar over a network with losses, and SLAM over a day,
accelerated."""

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
#: Duration of the repeated walk, s; interval of memory measurements, s; share of a session for warm-up.
WALK, LOOK, WARM = 5.0, 1.0, 0.2
#: Interval at which the disk is filled, and time for which it stays full, s; disk space per frame, kiB.
FULL_EVERY, FULL_FOR, ROOM_FOR_A_FRAME = 120.0, 3.0, 400
#: Walls of a room, m; path through it, m; walking time per hour, s; scan rate, Hz.
ROOM = np.concatenate([box(0, 0, 8, 6), box(3, 2.5, 3.6, 3.1), box(7, 0, 8, 0.6), box(0, 5, 0.5, 6)])
ROUND, WALKED, RATE = [[1, 1], [6, 1], [6, 4.5], [1, 4.5], [1, 1]], 60.0, 5.0


def pester(port: int, ended: threading.Event, counts: dict[str, int]) -> None:
    """Send forged packets from the board's address: a valid header with random content."""
    rng = np.random.default_rng(0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind((BOARD, 0))
        while not ended.wait(0.05):
            header = int(rng.integers(2**32)).to_bytes(4, "little") + int(rng.integers(2**48)).to_bytes(6, "little")
            stranger.sendto(header + rng.bytes(int(rng.integers(MAX_PAYLOAD))), (COMPUTER, port))
            counts["forged"] += 1


def look_on(url: str, ended: threading.Event, counts: dict[str, int]) -> None:
    """Visit the page repeatedly, reading its events for a while."""
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
    """Fill the disk at intervals."""
    while not ended.wait(FULL_EVERY):
        fill(place / "large")
        counts["full"] += 1
        ended.wait(FULL_FOR)
        (place / "large").unlink()


def live(minutes: float, folder: Path, seed: int) -> tuple[dict[str, object], str]:
    """Run a session with the virtual radar: a row of the table, and warnings of its recording."""
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
    memory = np.array(memory[:-2])  # without the final optimisation of the graph
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
    """Run endless SLAM as fast as possible: at rest, with a walk of a minute in the same room every hour."""
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
        "case": f"SLAM, accelerated, {hours:g} h at rest, {WALKED:g} s of walking per hour",
        "frames": frames,
        "nodes kept": len(slam.nodes),
        "position error, m": float(np.hypot(*(now - true)[:2])),
        "position error of odometry, m": float(np.hypot(*(odometry - true)[:2])),
        "MB after warm-up": memory[min(1 + int(WARM * len(memory)), len(memory) - 1)],
        "MB at the end": float(memory[-1]),
        "MB at most": max(memory),
    }


@script(
    "Long sessions",
    minutes=(60.0, "duration of the live session, min; 0: none"),
    hours=(24.0, "duration of accelerated SLAM, h; 0: none"),
    seed=(0, "seed of walk, network and noise"),
)
def main(options: argparse.Namespace) -> Page:
    """Run both sessions."""
    rows = []
    notes = [
        f"live: {WALK:g} s of a simulated office, repeated; every sample is compared with the one sent, and the mark "
        "of every chirp with the losses of the simulated network. Forged packets have the board's address and another "
        "port; a client reads the events of the page for 3 s at a time.",
        f"Memory: resident size of the session and the receiving process; warm-up: {WARM:.0%} of the duration. The "
        f"scan rate of SLAM is {RATE:g} Hz.",
        f"Every {FULL_EVERY:g} s the recording's disk is full for {FULL_FOR:g} s; frames of this time are not written, "
        "and counted.",
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
