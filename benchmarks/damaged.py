"""Damaged files and faulty environments: results of commands for each kind of damage.

The damaged files are made from one simulated walk. `_BEFORE` has the results of this script at commit 5718bfa.
"""

import argparse
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np
import trimesh
from typer.testing import CliRunner

from benchmarks.results import Data, Page, script, surroundings, tracked
from radarize.cli import app
from radarize.io.recording import Recording
from radarize.radar.cfg import write_cfg
from radarize.radar.dca1000 import Packet, encode
from radarsim.cli import app as radarsim

#: Recording of the walk, simulated once.
WALK = Path("build/damaged/walk.h5")
SIMULATE = ["office", "--platform", "cart", "--duration", "7", "--seed", "1"]
#: Maximum length of an output in the table, characters.
_SHOWN = 220
_BEFORE = {
    "64 bytes of a chunk zeroed: export": "exit 2, nothing exported",
    "64 bytes of a chunk zeroed: report": "exit 2, no page",
    "64 bytes of a chunk zeroed: run": "exit 2, no run",
    "64 bytes of a chunk zeroed: info": "exit 0, no word of it",
    "64 bytes of a chunk zeroed: recover": "exit 2: another program is writing there",
    "a .part that was closed cleanly: recover": "exit 2: another program is writing there",
    "NaN for stamp 50: recover": "exit 2: another program is writing there",
    "zero for stamp 50: recover": "exit 2: time does not ascend",
    "stamp 49 twice: recover": "exit 2: time does not ascend",
    "a bit of stamp 50 flipped: recover": "exit 2: another program is writing there",
    "the last block of stamps never written: recover": "exit 2: another program is writing there",
    "NaN for stamp 50: info": "50 frames, without a word",
    "zero for stamp 50: info": "exit 2: time does not ascend",
    "stamp 49 twice: info": "exit 2: time does not ascend",
    "a bit of stamp 50 flipped: info": "50 frames, without a word",
    "the last block of stamps never written: info": "0 frames, without a word",
    "time shorter than adc: info": "150 frames, without a word",
    "valid shorter than adc: info": "150 frames, without a word",
    "two starts of the radar": "60 frames of both, glued; 5063 packets came too late",
    "two boards": "50 frames of both, mixed; 1 packet came too late",
    "two ports": "50 frames, no word of the other board",
    "packets cut by snaplen": "49 frames, all lost, no reason",
    "packets in IP fragments": "49 frames, all lost, no reason",
    "two packets missing in a .bin": "209 frames, 149 of them shifted, no word of it",
    "one byte missing in a .bin": "209 frames, 149 of them noise, no word of it",
    "one chirp missing in a .bin": "209 frames, 149 of them shifted, no word of it",
    "seven packets missing in a .bin": "209 frames, 149 of them shifted, no word of it",
    "frames of 64 samples from frame 100 on": "173 frames, 73 of them noise, no word of it",
    "--tx 1 on samples of three transmitters": "60 frames, no word of it",
    "a bag's header 1 s ahead": "70 frames, 30 dropped as out of order",
    "a bag's header 1 h ahead": "51 frames, 49 dropped as out of order",
    "a mesh room without a floor": "moved down by 2.6 m, no word of the floor",
    "a name that is no UTF-8: report": "exit 2: internal error, UnicodeEncodeError",
}
Case = Callable[[Path], list[str]]
CASES: dict[str, tuple[int, Case]] = {}


def case(kind: int, name: str, *arguments: object) -> Callable:
    """Register a case: a function that makes files in a folder and returns the command that reads them."""

    def enter(make: Callable) -> Callable:
        CASES[name] = kind, lambda folder: make(folder, *arguments)
        return make

    return enter


# --- recordings -------------------------------------------------------------------------------------------------------
def _walk(folder: Path, name: str = "a.h5") -> Path:
    return Path(shutil.copyfile(WALK, folder / name))


def _zeroed(path: Path) -> Path:
    with h5py.File(path) as file:
        chunk = file["radar/adc"].id.get_chunk_info(96)
    with path.open("r+b") as file:
        file.seek(chunk.byte_offset + chunk.size // 2)
        file.write(bytes(64))
    return path


@case(1, "64 bytes of a chunk zeroed: info", "info")
@case(1, "64 bytes of a chunk zeroed: run", "run")
@case(1, "64 bytes of a chunk zeroed: report", "report")
@case(1, "64 bytes of a chunk zeroed: export", "export")
def _damaged_chunk(folder: Path, command: str) -> list[str]:
    path = str(_zeroed(_walk(folder)))
    methods = ["--odometry", "doppler", "--scans", "first-echo"]
    more = {
        "info": [], "run": ["-o", str(folder / "run"), *methods], "report": ["-o", str(folder / "a.html")],
        "export": ["--format", "bin", "-o", str(folder / "b.bin")],
    }  # fmt: skip
    return [command, path, *more[command]]


@case(1, "64 bytes of a chunk zeroed: recover", True)
@case(2, "a .part that was closed cleanly: recover", False)
def _recovered(folder: Path, damaged: bool) -> list[str]:
    path = _walk(folder, "a.h5.part")
    return ["recover", str(_zeroed(path) if damaged else path)]


def _stamped(folder: Path, change: Callable[[np.ndarray], None], part: bool) -> list[str]:
    path = _walk(folder, "a.h5.part" if part else "a.h5")
    with h5py.File(path, "r+") as file:
        times = file["radar/time"][:]
        change(times)
        file["radar/time"][:] = times
    if part:  # as a killed writer leaves it
        return ["recover", str(path)]
    return ["info", str(path)]


def _put(places: object, value: object) -> Callable[[np.ndarray], None]:
    def change(times: np.ndarray) -> None:
        times[places] = value(times) if callable(value) else value

    return change


def _flipped(times: np.ndarray) -> np.ndarray:
    return (times[50:51].view(np.uint64) ^ np.uint64(1 << 62)).view(float)


for _part, _command in ((True, "recover"), (False, "info")):
    case(2, f"NaN for stamp 50: {_command}", _put(50, np.nan), _part)(_stamped)
    case(2, f"zero for stamp 50: {_command}", _put(50, 0.0), _part)(_stamped)
    case(2, f"stamp 49 twice: {_command}", _put(50, lambda times: times[49]), _part)(_stamped)
    case(2, f"a bit of stamp 50 flipped: {_command}", _put(slice(50, 51), _flipped), _part)(_stamped)
    case(2, f"the last block of stamps never written: {_command}", _put(slice(None), np.nan), _part)(_stamped)


@case(2, "time shorter than adc: info", "time")
@case(2, "valid shorter than adc: info", "valid")
def _shorter(folder: Path, name: str) -> list[str]:
    path = _walk(folder)
    with h5py.File(path, "r+") as file:
        file[f"radar/{name}"].resize(150, axis=0)
    return ["info", str(path)]


# --- network captures -------------------------------------------------------------------------------------------------
def _sent(start: int, stop: int, source: str = "192.168.33.180", port: int = 4098) -> Iterator[bytes]:
    """Yield Ethernet frames with a board's packets of some frames of the walk."""
    with Recording(WALK) as recording:
        stream = encode(recording.adc(start, stop), recording.config).tobytes()
    for number, at in enumerate(range(0, len(stream), 1456)):
        yield _ethernet(Packet(number + 1, at, stream[at : at + 1456]).encode(), source, port)


def _ethernet(payload: bytes, source: str, port: int, flags: int = 0) -> bytes:
    addresses = socket.inet_aton(source) + socket.inet_aton("192.168.33.30")
    header = struct.pack(">BBHHHBBH", 0x45, 0, 28 + len(payload), 0, flags, 64, 17, 0) + addresses
    udp = struct.pack(">HHHH", 4096, port, 8 + len(payload), 0)
    return bytes(12) + b"\x08\x00" + header + udp + payload


def _pcap(folder: Path, packets: list[bytes]) -> list[str]:
    head = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
    records = (
        struct.pack("<IIII", 1000 + k // 9000, k % 9000 * 100, len(p), len(p)) + p for k, p in enumerate(packets)
    )
    (folder / "a.pcap").write_bytes(head + b"".join(records))
    return _imported(folder, "a.pcap")


def _imported(folder: Path, name: str, *more: str) -> list[str]:
    with Recording(WALK) as recording:
        (folder / "c.cfg").write_text(write_cfg(recording.config))
    return ["import", str(folder / name), "--config", str(folder / "c.cfg"), "-o", str(folder / "out.h5"), *more]


def _turns(one: Iterator[bytes], other: Iterator[bytes]) -> list[bytes]:
    return [packet for pair in zip(one, other, strict=True) for packet in pair]


case(3, "two starts of the radar")(lambda folder: _pcap(folder, [*_sent(0, 50), *_sent(100, 160)]))
case(3, "two boards")(lambda folder: _pcap(folder, _turns(_sent(0, 50), _sent(100, 150, "192.168.33.181"))))
case(3, "two ports")(lambda folder: _pcap(folder, _turns(_sent(0, 50), _sent(100, 150, port=4099))))
case(3, "packets cut by snaplen")(lambda folder: _pcap(folder, [packet[:96] for packet in _sent(0, 50)]))
case(3, "packets in IP fragments")(
    lambda folder: _pcap(folder, [_ethernet(p[42:], "192.168.33.180", 4098, 0x2000)[:700] for p in _sent(0, 50)])
)


# --- raw captures -----------------------------------------------------------------------------------------------------
@case(4, "two packets missing in a .bin", 2912)
@case(4, "one byte missing in a .bin", 1)
@case(4, "one chirp missing in a .bin", 1536)
@case(4, "seven packets missing in a .bin", 7 * 1456)
def _cut(folder: Path, missing: int) -> list[str]:
    with Recording(WALK) as recording:
        data = encode(recording.adc(0, len(recording)), recording.config).tobytes()
    at = 60 * len(data) // 210 + 54321
    (folder / "a.bin").write_bytes(data[:at] + data[at + missing :])
    return _imported(folder, "a.bin")


@case(4, "frames of 64 samples from frame 100 on")
def _another_size(folder: Path) -> list[str]:
    with Recording(WALK) as recording:
        config, adc = recording.config, recording.adc(0, len(recording))
    small = config.model_copy(update={"samples": 64})
    data = encode(adc[:100], config).tobytes() + encode(np.ascontiguousarray(adc[100:, ..., :64, :]), small).tobytes()
    (folder / "a.bin").write_bytes(data)
    return _imported(folder, "a.bin")


@case(6, "--tx 1 on samples of three transmitters")
def _one_transmitter(folder: Path) -> list[str]:
    with Recording(WALK) as recording:
        (folder / "a.bin").write_bytes(encode(recording.adc(0, 60), recording.config).tobytes())
    return [
        "import", str(folder / "a.bin"), "-o", str(folder / "out.h5"), "--samples", "96", "--loops", "96", "--rx", "4",
        "--tx", "1", "--iq-order", "qqii",
    ]  # fmt: skip


@case(6, "a bag's header 1 s ahead", 1.0)
@case(6, "a bag's header 1 h ahead", 3600.0)
def _header_ahead(folder: Path, ahead: float) -> list[str]:
    from tests.io.importers.ros import BagWriter

    with Recording(WALK) as recording, BagWriter(folder / "a.bag", 1) as bag:
        for k in range(100):
            time, adc = float(recording.times[k]), recording.adc(k, k + 1)[0]
            bag.frame(time, adc, recording.config, latency=0.02, stamp=time + ahead * (k == 50))
    return _imported(folder, "a.bag")


@case(7, "a mesh room without a floor")
def _room(folder: Path) -> list[str]:
    corners = [(0, 0), (6, 0), (6, 5), (0, 5)]
    sides = [
        trimesh.Trimesh([(*a, 0), (*b, 0), (*b, 2.6), (*a, 2.6)], [(0, 1, 2), (0, 2, 3)])
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True)
    ]
    lid = trimesh.Trimesh([(*corner, 2.6) for corner in corners], [(0, 2, 1), (0, 3, 2)])
    trimesh.util.concatenate([*sides, lid]).export(folder / "room.ply")
    return ["radarsim", "scene", "import", str(folder / "room.ply"), "-o", str(folder / "room.yaml")]


@case(7, "a name that is no UTF-8: report")
def _no_utf8(folder: Path) -> list[str]:
    return ["report", str(_walk(folder, "walk \udcff.h5"))]


# --- results ----------------------------------------------------------------------------------------------------------
def invoked(words: list[str]) -> tuple[int, str]:
    """Return exit code and output of a command; it runs in a separate process if a name is not valid UTF-8."""
    if any("\udcff" in word for word in words):
        command = [sys.executable, "-m", "radarize.cli", *words]
        ended = subprocess.run(command, capture_output=True, text=True, errors="backslashreplace")
        return ended.returncode, ended.stdout if ended.returncode == 0 else ended.stderr
    commands = radarsim if words[0] == "radarsim" else app
    done = CliRunner().invoke(commands, words[words[0] == "radarsim" :])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        return 2, str(done.exception)
    return done.exit_code, done.stderr or done.stdout


def outcome(name: str, folder: Path) -> dict[str, object]:
    """Return a row of the table: result of the command on the files of a case."""
    kind, make = CASES[name]
    words = make(folder)
    code, output = invoked(words)
    marks = (
        "damaged",
        "cannot be unpacked",
        "rows",
        "captures",
        "missing in",
        "repeat every",
        "header",
        "floor",
        "moved",
    )
    lines = [line for line in output.splitlines() if any(mark in line for mark in marks)]
    lines = lines or output.strip().splitlines()[-1:]
    frames = lost = None
    for path in sorted(folder.glob("*.h5")):
        try:
            with Recording(path) as recording:
                valid = recording.valid(0, len(recording))
                frames, lost = (frames or 0) + len(recording), (lost or 0) + int(valid.size - valid.sum())
        except Exception:  # at an earlier commit
            pass
    shown = " ".join("".join(c if c.isprintable() else " " for c in "; ".join(lines)).replace("|", "/").split())
    shown = shown.replace(str(folder) + "/", "")
    return {
        "kind": kind,
        "case": name,
        "before": _BEFORE.get(name, "-"),
        "exit code": code,
        "frames": frames,
        "chirps lost": lost,
        "now": shown if len(shown) <= _SHOWN else shown[:_SHOWN] + " ...",
        "source kept": (folder / "a.h5.part").exists() if words[0] == "recover" else None,
    }


@script("Damaged files and faulty environments", cases=(0, "number of cases, from the first; 0: all"))
def main(options: argparse.Namespace) -> Page:
    """Run all cases."""
    warnings.simplefilter("ignore")
    if not WALK.exists():
        WALK.parent.mkdir(parents=True, exist_ok=True)
        subprocess.run([sys.executable, "-m", "radarsim.cli", "simulate", *SIMULATE, "-o", WALK], check=True)
    rows = []
    for name in tracked(list(CASES)[: options.cases or None], "damaged"):
        with tempfile.TemporaryDirectory(prefix="damaged-") as folder:
            rows.append(outcome(name, Path(folder)))
    return Page(
        rows,
        data=Data("one simulated walk of 210 frames (office, cart)", (), 1),
        notes=[
            "kind: 1 a frame that cannot be unpacked; 2 a `.part`, and time stamps; 3 several captures in one; 4 bytes "
            "missing in raw samples; 6 headers and transmitters; 7 environment. Faults without an error message are "
            "found by `radarize check`.",
            "before: result of this script at commit 5718bfa. frames: in all recordings after the command. Each case "
            "has 210 frames, except 110, 100, 100, 50 and 50 in the network captures, 60 in --tx 1, 100 in bags.",
            "A deleted working folder, full shared memory and an early Ctrl-C are tested in "
            "`tests/io/test_surroundings.py`.",
            surroundings(),
        ],
    )
