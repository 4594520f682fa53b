"""`radarize capture` against `radarsim emulate`, each a process of its own: frames lost, and what each side costs."""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import psutil
from jaxtyping import Bool, Int16

from benchmarks.results import Data, Page, script, surroundings
from radarize.io.recording import Losses, Recording, RecordingWriter
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import MAX_PAYLOAD
from radarize.radar.presets import load_config
from radarsim.emulator.disturbance import Disturbance
from tests.virtual import emulator

LOOP = 64  # frames played again and again
NOISE = 40  # counts, RMS: about an IWR1843's at 30 dB of gain in a room


def used(process: subprocess.Popen) -> float:
    """Processor time of a process and its children, those that have ended included, s."""
    root = psutil.Process(process.pid)
    return sum(sum(each.cpu_times()[:4]) for each in (root, *root.children(recursive=True)))


def chirps_that_arrive(config: RadarConfig, frames: int, network: Disturbance) -> Bool[np.ndarray, "frame loop tx"]:
    """Chirps (physical order) of which a network loses no packet."""
    count = -(-frames * config.frame_bytes // MAX_PAYLOAD)
    sent = (number.to_bytes(8, "little") for number in range(count))
    through = [packet for each in sent for packet in network(each)] + list(network.rest())
    lost = np.ones(count, int)
    lost[np.unique(np.frombuffer(b"".join(through), "<u8"))] = 0
    before = np.concatenate([[0], np.cumsum(lost)])  # lost packets before each
    loops, tx = config.frame_shape[:2]
    size = config.frame_bytes // (loops * tx)
    first = size * np.arange(frames * loops * tx)
    hit = before[(first + size - 1) // MAX_PAYLOAD + 1] - before[first // MAX_PAYLOAD]
    return (hit == 0).reshape(frames, loops, tx)[:, :, list(config.slot)]


def compared(
    path: Path, played: Int16[np.ndarray, "frame loop tx rx sample 2"], arriving: Bool[np.ndarray, "frame loop tx"]
) -> tuple[Losses, int, int, str]:
    """A capture of frames that were played again and again: losses, chirps mismarked, chirps wrong, warnings."""
    wrong, mismarked = 0, 0
    with Recording(path) as recording:
        losses = Losses(recording.config.frame_period)
        numbers = np.round((recording.times - recording.times[0]) / recording.config.frame_period).astype(int)
        for where, adc in recording.batches(LOOP):
            valid = recording.valid(where.start, where.stop)
            losses.add(valid, recording.times[where])
            mismarked += int((valid != arriving[numbers[where]]).sum())
            sent = played[numbers[where] % len(played)]
            wrong += int((adc[valid] != sent[valid]).any(axis=(1, 2, 3)).sum())
            wrong += int(((adc != sent) & (adc != 0))[~valid].any(axis=(1, 2, 3)).sum())
        return losses, mismarked, wrong, recording.attributes["warnings"]


def run(
    config: RadarConfig, preset: str, seconds: float, folder: Path, seed: int, shares: dict[str, float]
) -> tuple[dict[str, object], str]:
    """One capture: a row of the table, and what the recording warns of."""
    options = [word for name, share in shares.items() for word in (f"--{name}", str(share))]
    rng = np.random.default_rng(seed)
    played = rng.normal(0, NOISE, (LOOP, *config.frame_shape)).round().astype(np.int16)
    with RecordingWriter(folder / "played.h5", config) as writer:
        writer.append(played, np.arange(LOOP) * config.frame_period)
    frames = round(seconds / config.frame_period)
    with emulator(folder / "played.h5", folder, "--loop", *options, "--seed", seed) as board:
        time.sleep(3)  # frames are made ahead
        capture = [
            sys.executable, "-m", "radarize.cli", "capture", "--config", preset, *board.options,
            "--frames", frames, "-o", folder / "captured.h5",
        ]  # fmt: skip
        before, begun = used(board.process), os.times()
        subprocess.run([*map(str, capture)], check=True)
        theirs, ended = used(board.process) - before, os.times()
    wall = ended.elapsed - begun.elapsed
    ours = ended.children_user + ended.children_system - begun.children_user - begun.children_system
    late = re.findall(r"(\d+) of them late, ([\d.]+) s", board.output)
    arriving = chirps_that_arrive(config, frames, Disturbance(**shares, rng=np.random.default_rng(seed)))
    losses, mismarked, wrong, warnings = compared(folder / "captured.h5", played, arriving)
    row = {
        "configuration": " ".join([preset, *options]),
        "frames": frames,
        "frames/s": config.frame_rate,
        "Mbit/s": 8e-6 * config.frame_bytes * config.frame_rate,
        "frames not written": frames - losses.frames,
        "frames with lost samples": losses.hit_frames,
        "chirps lost": losses.lost_chirps,
        "lost but not marked, or marked but not lost": mismarked,
        "chirps with a wrong sample": wrong,
        "emulator late, s": float(late[-1][1]) if late else 0.0,
        "capture, share of a core": ours / wall,
        "emulator, share of a core": theirs / wall,
    }
    return row, warnings


@script(
    "Capture at the virtual radar",
    seconds=(300.0, "length of the capture"),
    config=("radarize", "preset or .cfg"),
    bad_seconds=(60.0, "length of another one over a bad network; 0: none"),
    seed=(0, "of noise and network"),
)
def main(options: argparse.Namespace) -> Page:
    """The table."""
    config, _ = load_config(options.config)
    rows: list[dict[str, object]] = []
    notes = [
        f"Noise of {NOISE} counts RMS, {LOOP} frames played again and again; every sample compared with the one sent, "
        "and every chirp's mark with what the network's seed says was lost.",
        "Frames are not written if disk or processor are too slow for them; the emulator is late if it gets no time.",
        surroundings(),
    ]
    bad = {"loss": 0.01, "duplicate": 0.01, "reorder": 0.01}
    for seconds, shares in ((options.seconds, {}), (options.bad_seconds, bad)):
        if not seconds:
            continue
        with tempfile.TemporaryDirectory() as folder:
            row, warnings = run(config, options.config, seconds, Path(folder), options.seed, shares)
        rows.append(row)
        notes += [f"{row['configuration']}: {warnings}."] if warnings else []
    data = Data("simulated noise, played by `radarsim emulate`", (), options.seed)
    return Page(rows, data=data, notes=notes)
