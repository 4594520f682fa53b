"""Every reader of foreign bytes with the inputs to try it on: one definition for the tests and for the long run.

An input must end in a result or an InputError of one line, soon, and without memory that it has not the size for.
"""

import functools
import json
import re
import shutil
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy
from rosbags.rosbag2 import StoragePlugin
from scipy.io import savemat

import radarize.importers.bag  # noqa: F401 -- imported at first use, and what its libraries take is no input's memory
from radarize.contents import contents
from radarize.errors import InputError
from radarize.evaluation.evaluate import evaluate
from radarize.features.grid import Grid
from radarize.importers import Given, import_recording
from radarize.log import Log
from radarize.methods.radarize.motion import RotationNet
from radarize.nets.weights import Header, build, save
from radarize.nets.weights import load as load_weights
from radarize.radar.assembler import FrameAssembler
from radarize.radar.cfg import write_cfg
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import decode, encode
from radarize.radar.dca1000_commands import Command, Reply, Request, Status, packet_settings, read_packet_settings
from radarize.radar.limits import check_limits
from radarize.radar.presets import PRESETS, load_config
from radarize.recording import Product, Recording, RecordingWriter, Stream
from radarize.runfolder import RunFolder
from radarize.runfolder.reader import SHAPES
from radarize.tum import read_tum
from tests.evaluation.fake_run import write_run
from tests.fuzzing.damage import damaged, misspelled
from tests.fuzzing.hdf5 import RECORDING, altered, edits
from tests.importers.ros import write_published
from tests.importers.test_import_pcap import pcap, pcapng, udp
from tests.packets import packets

RECORDINGS = Path(__file__).resolve().parents[3] / "shared" / "recordings"
#: A reader may take so much processor time (s), and memory (bytes): buffers of a fixed size, and so many times the
#: input's.
MOST_SECONDS, MOST_MEMORY, MOST_TIMES = 5.0, 96 << 20, 20
#: 3,072 bytes a frame.
CONFIG = RadarConfig(
    start_frequency=77e9, slope=60e12, idle_time=20e-6, adc_start_time=5e-6, ramp_end_time=60e-6, samples=32,
    sample_rate=5e6, loops=2, frame_period=50e-3, tx_order=(0, 2, 1),
)  # fmt: skip
FRAMES = np.random.default_rng(0).integers(-300, 300, (3, *CONFIG.frame_shape), dtype=np.int16)
CUBE = FRAMES[..., 0] + 1j * FRAMES[..., 1].astype(np.float32)


@dataclass(frozen=True)
class Reader:
    """A reader and what it is tried on.

    Attributes:
        inputs: what is drawn.
        place: writes an input's files into an empty folder; gives what `read` takes.
        read: raises InputError to refuse its input.
        size: bytes of an input.
    """

    inputs: SearchStrategy
    place: Callable[[object, Path], object]
    read: Callable[[object], None]
    size: Callable[[object], int] = len


@dataclass(frozen=True)
class Attempt:
    """What came of an input: whether it was read, processor time (s), and memory beyond what was in use (bytes)."""

    accepted: bool
    seconds: float
    memory: int


def attempt(reader: Reader, data: object, folder: Path) -> Attempt:
    """Place an input in an empty folder, read it, and clear the folder.

    Raises:
        AssertionError: it was refused in other words than a sentence, took too long, or too much memory.
        Exception: whatever else than an InputError the reader raised.
    """
    placed, accepted = reader.place(data, folder), True
    before, start = _peak_memory(anew=True), time.process_time()
    try:
        reader.read(placed)
    except InputError as error:
        accepted, text = False, str(error)
        assert text.isprintable() and 10 < len(text) < 1500, f"{text[:200]!r}... is no sentence"
    seconds, memory = time.process_time() - start, _peak_memory() - before
    clear(folder)
    assert seconds < MOST_SECONDS, f"took {seconds:.1f} s"
    assert memory < MOST_MEMORY + MOST_TIMES * reader.size(data), f"took {memory >> 20} MiB"
    return Attempt(accepted, seconds, memory)


def _peak_memory(anew: bool = False) -> int:
    """Largest resident memory of this process, bytes; `anew`: of all times to come, now (proc(5), clear_refs)."""
    if anew:
        Path("/proc/self/clear_refs").write_text("5")
    return 1024 * int(re.search(r"VmHWM:\s*(\d+)", Path("/proc/self/status").read_text())[1])


def clear(folder: Path) -> None:
    """Leave nothing in a folder."""
    for path in folder.iterdir():
        shutil.rmtree(path) if path.is_dir() else path.unlink()


def _file(name: str) -> Callable[[bytes, Path], Path]:
    """Places an input as a file of such a name."""

    def place(data: bytes, folder: Path) -> Path:
        (folder / name).write_bytes(data)
        return folder / name

    return place


def _importing(**more) -> Callable[[Path], None]:
    """Imports a file, and reads what came of it."""

    def read(path: Path) -> None:
        use(import_recording(path, path.with_name("out.h5"), Given(**({"config": CONFIG} | more))))

    return read


def use(path: Path) -> None:
    """Read a recording as the commands do."""
    contents(path)
    with Recording(path) as recording:
        for name in recording.names():
            for read in (recording.describe, recording.read, lambda name: recording.rows(name, 0, 2)):
                try:
                    read(name)
                except InputError:
                    pass  # the others may be sound
        for batch, adc in recording.batches(16):
            assert len(recording.valid(batch.start, batch.stop)) == len(adc)


# --- text -------------------------------------------------------------------------------------------------------------
def cfg() -> Reader:
    """SDK commands."""

    def read(path: Path) -> None:
        config, _ = load_config(path)
        check_limits(config)
        write_cfg(config)

    texts = [path.read_text() for path in sorted(RECORDINGS.rglob("*.cfg"))]
    texts += [write_cfg(config) for config in PRESETS.values()]
    return Reader(misspelled(texts), _file("profile.cfg"), read)


def studio() -> Reader:
    """A mmWave Studio folder: settings or setup damaged, the samples sound."""
    samples = encode(FRAMES, CONFIG).tobytes()
    mmwave, setup = _studio_texts()

    def place(files: tuple[bytes, bytes], folder: Path) -> Path:
        (folder / "a.mmwave.json").write_bytes(files[0])
        (folder / "a.setup.json").write_bytes(files[1])
        (folder / "adc_data.bin").write_bytes(samples)
        return folder

    def read(folder: Path) -> None:
        use(import_recording(folder, folder / "out.h5"))

    inputs = st.one_of(
        st.tuples(misspelled([mmwave]), st.just(setup.encode())),
        st.tuples(st.just(mmwave.encode()), misspelled([setup])),
    )
    return Reader(inputs, place, read, lambda files: sum(map(len, files)) + len(samples))


def _studio_texts() -> tuple[str, str]:
    """Settings that fit `CONFIG`, in the words of the public capture or, where that is absent, as few as will do."""
    raw = {"rlDevDataFmtCfg_t": {"iqSwapSel": 1, "chInterleave": 1}, "rlDevLaneEnable_t": {"laneEn": "0x3"}}
    raw["rlDevDataPathCfg_t"] = {"transferFmtPkt0": "0x1"}
    profile = {
        "profileId": 0, "startFreqConst_GHz": 77.0, "freqSlopeConst_MHz_usec": 60.0, "idleTimeConst_usec": 20.0,
        "adcStartTimeConst_usec": 5.0, "rampEndTime_usec": 60.0, "numAdcSamples": 32, "digOutSampleRate": 5000,
        "rxGain_dB": "0x1E", "txOutPowerBackoffCode": "0x0", "hpfCornerFreq1": "0x0", "hpfCornerFreq2": "0x0",
    }  # fmt: skip
    still = dict.fromkeys(
        ("startFreqVar_MHz", "freqSlopeVar_KHz_usec", "idleTimeVar_usec", "adcStartTimeVar_usec"), 0.0
    )
    chirps = [
        {"rlChirpCfg_t": {"chirpStartIdx": k, "chirpEndIdx": k, "profileId": 0, **still, "txEnable": f"0x{1 << tx:x}"}}
        for k, tx in enumerate(CONFIG.tx_order)
    ]
    rf = {
        "waveformType": "legacyFrameChirp",
        "rlAdcOutCfg_t": {"fmt": {"b2AdcBits": 2, "b2AdcOutFmt": 1}},
        "rlChanCfg_t": {"rxChannelEn": "0xF"},
        "rlFrameCfg_t": {"chirpStartIdx": 0, "chirpEndIdx": 2, "numLoops": 2, "framePeriodicity_msec": 50.0},
        "rlProfiles": [{"rlProfileCfg_t": profile}],
        "rlChirps": chirps,
    }
    entry = {"processedFileName": "adc_data.bin", "processedFileSummary": {"numZeroFillBytes": 0}}
    setup = {"mmWaveDevice": "iwr6843", "capturedFiles": {"files": [entry]}}
    return json.dumps({"mmWaveDevices": [{"rfConfig": rf, "rawDataCaptureConfig": raw}]}, indent=1), json.dumps(setup)


def tum() -> Reader:
    """Trajectories."""
    lines = "\n".join(f"{0.1 * k:.3f} {k} 0 1.2 0 0 0 1" for k in range(20))
    return Reader(misspelled([f"# time x y z qx qy qz qw\n{lines}\n"]), _file("poses.tum"), read_tum)


# --- the network ------------------------------------------------------------------------------------------------------
def udp_packets() -> Reader:
    """Data packets of a DCA1000, its commands, replies and settings."""
    sound = [packet.encode() for packet in packets(encode(FRAMES, CONFIG).tobytes())]
    others = [Request(Command.ALIVE).encode(), Request(Command.PACKETS, packet_settings()).encode(), packet_settings()]
    others += [Reply(Command.STATUS, Status.MEMORY_FULL).encode()]

    def read(stream: list[bytes]) -> None:
        assembler = FrameAssembler(CONFIG)
        assembler.furthest = 100 * CONFIG.frame_bytes
        for frames in (*map(assembler.take, stream), assembler.finish()):
            for words, valid in frames:
                assert decode(words, CONFIG).shape[1:] == CONFIG.frame_shape and valid.shape == (2, 3)
        counts = assembler.counts
        assert counts.received + counts.duplicates + counts.late + counts.damaged + counts.stray == len(stream)
        for data in stream:
            for meaning in (Request.decode, Reply.decode, read_packet_settings):
                try:
                    meaning(data)
                except InputError:
                    pass

    one = st.one_of(st.sampled_from(sound), damaged(sound), damaged(others))
    inputs = st.lists(one, min_size=1, max_size=8)
    return Reader(inputs, lambda stream, folder: stream, read, lambda stream: sum(map(len, stream)))


def network_capture() -> Reader:
    """A pcap of the stream."""
    with tempfile.TemporaryDirectory() as folder:
        stream = [udp(packet.encode()) for packet in packets(encode(FRAMES, CONFIG).tobytes())]
        seeds = [pcap(Path(folder) / "a", stream).read_bytes(), pcap(Path(folder) / "b", stream, ">").read_bytes()]
        seeds.append(pcapng(Path(folder) / "c", stream).read_bytes())
    seeds += [path.read_bytes() for path in sorted((RECORDINGS / "iwr1843-pcap").glob("*.pcap"))]
    return Reader(damaged(seeds), _file("a.pcap"), _importing())


# --- samples ----------------------------------------------------------------------------------------------------------
def raw_words() -> Reader:
    """A .bin, with settings by hand that need not fit it."""
    seed = encode(FRAMES, CONFIG).tobytes()
    count = st.one_of(st.integers(-1, 300), st.sampled_from((0, 65535, 10**6, 2**31, 2**64)))
    given = st.fixed_dictionaries(
        {},
        optional={
            **{name: count for name in ("samples", "loops", "rx", "tx")},
            **{name: st.floats() for name in ("start_frequency", "slope", "sample_rate", "frame_period", "start_time")},
            "iq_order": st.sampled_from(("qqii", "iiqq", "")),
        },
    )

    def place(what: tuple[bytes, dict, bool], folder: Path) -> tuple[Path, dict, bool]:
        data, overrides, configured = what
        (folder / "a_Raw_0.bin").write_bytes(data[:4001])
        (folder / "a_Raw_1.bin").write_bytes(data[4001:])
        return folder / "a_Raw_0.bin", overrides, configured

    def read(placed: tuple[Path, dict, bool]) -> None:
        path, overrides, configured = placed
        _importing(config=CONFIG if configured else None, overrides=overrides)(path)

    return Reader(st.tuples(damaged([seed]), given, st.booleans()), place, read, lambda what: len(what[0]))


def arrays(kind: str) -> Reader:
    """npy, npz or mat files, in every way of storing them."""
    with tempfile.TemporaryDirectory() as name:
        folder, seeds = Path(name), []

        def keep(save: Callable[..., None], *what, **more) -> None:
            save(folder / f"a.{kind}", *what, **more)
            seeds.append((folder / f"a.{kind}").read_bytes())

        if kind == "npy":
            for values in (CUBE, FRAMES, np.asfortranarray(CUBE), FRAMES.astype("<u2")):
                keep(np.save, values)
        elif kind == "npz":
            keep(np.savez, adc=CUBE, time=np.arange(3))
            keep(np.savez_compressed, adc=CUBE, time=np.arange(3))
        else:
            keep(savemat, {"adc": CUBE, "fs": 5e6})
            keep(savemat, {"adc": CUBE, "fs": 5e6}, do_compression=True)
            keep(savemat, {"adc": FRAMES, "s": {"a": 1}, "c": np.array([1, "x"], object)}, format="5")
            keep(savemat, {"adc": CUBE.reshape(3, -1)}, format="4")
            for version in ("earliest", "latest"):
                keep(_matlab73, version)
    given, found = _importing(shape="frame,loop,tx,rx,sample,iq" if kind == "npy" else None), _importing(config=None)
    inputs = damaged(seeds)
    return Reader(inputs, _file(f"a.{kind}"), lambda path: (given if path.stat().st_size % 2 else found)(path))


def _matlab73(path: Path, version: str) -> None:
    pairs = np.empty(CUBE.T.shape, [("real", "<f4"), ("imag", "<f4")])
    pairs["real"], pairs["imag"] = CUBE.T.real, CUBE.T.imag
    with h5py.File(path, "w", userblock_size=512, libver=version) as file:
        file["adc"] = pairs
        file["fs"] = np.zeros((1, 1))


# --- recordings and bags ----------------------------------------------------------------------------------------------
@functools.cache
def _recording() -> tuple[bytes, bytes]:
    """A recording with streams of every kind, finished and growing."""
    ticks = np.arange(0, 0.15, 0.005)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.h5"
        streams = {
            "truth/pose": Stream((7,), "f8", "m", ""),
            "truth/depth": Stream((100, 8), "u2", "mm", ""),
            "tracking/time": Stream((), "f8", "s", "", "tracking/time"),
            "tracking/pose": Stream((7,), "f8", "m", "", "tracking/time"),
            "imu/time": Stream((), "f8", "s", "", "imu/time"),
            "imu/accelerometer": Stream((3,), "f4", "m/s^2", "", "imu/time"),
            "imu/gyroscope": Stream((3,), "f4", "rad/s", "", "imu/time"),
            "points/frame": Stream((), "i4", "", "", "points/frame"),
            "points/cloud": Stream((6,), "f4", "m", "", "points/frame"),
        }
        still = np.tile([0, 0, 1, 0, 0, 0, 1.0], (len(ticks), 1))
        rows = {
            "truth/pose": still[:3],
            "truth/depth": np.ones((3, 100, 8)),
            "tracking/time": ticks,
            "tracking/pose": still,
            "imu/time": ticks,
            "imu/accelerometer": still[:, :3],
            "imu/gyroscope": still[:, :3],
            "points/frame": np.arange(3),
            "points/cloud": np.ones((3, 6)),
        }
        plan = {"truth/plan": Product(np.ones((4, 4)), "m", "")}
        with RecordingWriter(path, CONFIG, cfg_text=write_cfg(CONFIG), streams=streams, products=plan) as writer:
            writer.append(FRAMES, CONFIG.frame_period * np.arange(3), rows=rows)
            writer.flush()
            growing = writer.part.read_bytes()
        return path.read_bytes(), growing


def recording() -> Reader:
    """Our HDF5: bytes damaged (finished, without checksums, growing), or sound HDF5 with other content."""
    with tempfile.TemporaryDirectory() as folder:
        new, old = Path(folder) / "new.h5", Path(folder) / "old.h5"
        new.write_bytes(_recording()[0])
        with h5py.File(new) as source, h5py.File(old, "w", libver="earliest") as target:
            target.attrs.update(source.attrs)
            for name in source:
                source.copy(name, target)
        seeds = [new.read_bytes(), old.read_bytes(), _recording()[1]]

    def place(what: bytes | list[tuple], folder: Path) -> Path:
        path = folder / "a.h5"
        if isinstance(what, bytes):
            path.write_bytes(what)
        else:
            altered(seeds[0], what, path)
        return path

    inputs = st.one_of(damaged(seeds), edits(RECORDING))
    return Reader(inputs, place, use, lambda what: len(what if isinstance(what, bytes) else seeds[0]))


def bags(kind: str) -> Reader:
    """ROS bags: ``bag`` (ROS 1), ``mcap`` or ``db3``."""
    with tempfile.TemporaryDirectory() as name:
        source, path = Path(name) / "a.h5", Path(name) / f"a.{kind}"
        source.write_bytes(_recording()[0])
        if kind == "bag":
            seeds = [write_published(path, source).read_bytes()]
        else:
            storage = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
            folder = write_published(path.with_suffix(""), source, 2, storage)
            (stored,) = folder.glob(f"*.{kind}")
            seeds = [stored.read_bytes()]
    return Reader(damaged(seeds), _file(f"a.{kind}"), _importing())


# --- runs and weights -------------------------------------------------------------------------------------------------
@functools.cache
def _run() -> dict[str, bytes]:
    """The files of a run that knows the truth."""
    with tempfile.TemporaryDirectory() as name:
        folder = write_run(Path(name) / "RUN", walked=2.0)
        run = RunFolder(folder)
        run.write_metrics(evaluate(run))
        return {path.name: path.read_bytes() for path in folder.iterdir()}


def use_run(folder: Path) -> None:
    """Read all of a run."""
    Log.read(folder)
    run = RunFolder(folder)
    _ = run.blind
    for part in ("facts", "methods", "metrics", "trajectory", "odometry", "reference", "map"):
        getattr(run, part)
    if run.map is not None:
        run.map.centers(run.map.occupied)
    for name in run.scans:
        _ = run.scans[name]


def run_file(name: str, inputs: SearchStrategy) -> Reader:
    """A run in which one file is damaged."""

    def place(data: bytes, folder: Path) -> Path:
        for other, content in _run().items():
            (folder / other).write_bytes(content)
        (folder / name).write_bytes(data)
        return folder

    return Reader(inputs, place, use_run, lambda data: len(data) + sum(map(len, _run().values())))


def run_scans() -> Reader:
    """A run's HDF5: bytes damaged, or sound HDF5 with other content."""
    seed = _run()["scans.h5"]
    damages = run_file("scans.h5", st.one_of(damaged([seed]), edits(SHAPES)))

    def place(what: bytes | list[tuple], folder: Path) -> Path:
        damages.place(what if isinstance(what, bytes) else seed, folder)
        if not isinstance(what, bytes):
            altered(seed, what, folder / "scans.h5")
        return folder

    return Reader(damages.inputs, place, use_run, lambda what: len(seed) + 2 * len(what))


def log() -> Reader:
    """Scans of any sensor in an npz."""
    fields = {"ranges": np.ones((6, 40)), "angle_min": -1.0, "angle_increment": 0.05, "range_max": 10.0}
    with tempfile.TemporaryDirectory() as name:
        path, seeds = Path(name) / "a.npz", []
        for save, more in ((np.savez, {}), (np.savez_compressed, {"times": np.arange(6.0)})):
            save(path, **fields, **more)
            seeds.append(path.read_bytes())
        np.savez_compressed(path, **fields | {"ranges": np.zeros((5000, 5000))})  # 200 MB in 195 kB
        seeds.append(path.read_bytes())
    return Reader(damaged(seeds), _file("a.npz"), Log.read)


def weights() -> Reader:
    """A network's file."""
    seeds = []
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "a.safetensors"
        for width in (2, 4):
            grid = Grid.of(PRESETS["radarize"], "range_azimuth")
            header = Header(kind="rotation", frames=2, maps=("range_azimuth",), width=width, grid=grid)
            seeds.append(save(build(RotationNet, header), header, path).read_bytes())
    cuts = [(8 + int.from_bytes(seed[:8], "little"), seed) for seed in seeds]
    # A header with other numbers and words before the same tensors, and its length right.
    heads = st.one_of(
        *(
            misspelled([seed[8:cut].decode()]).map(
                lambda head, rest=seed[cut:]: len(head).to_bytes(8, "little") + head + rest
            )
            for cut, seed in cuts
        )
    )
    return Reader(
        st.one_of(damaged(seeds), heads), _file("a.safetensors"), lambda path: load_weights(path, RotationNet)
    )


#: By name, in the order of the table; making one writes its valid files.
READERS: dict[str, Callable[[], Reader]] = {
    "SDK .cfg": cfg,
    "mmWave Studio JSON": studio,
    "TUM poses": tum,
    "UDP packets": udp_packets,
    "pcap": network_capture,
    ".bin": raw_words,
    "npy": lambda: arrays("npy"),
    "npz": lambda: arrays("npz"),
    "mat": lambda: arrays("mat"),
    "HDF5 recording": recording,
    "ROS 1 bag": lambda: bags("bag"),
    "ROS 2 mcap": lambda: bags("mcap"),
    "ROS 2 db3": lambda: bags("db3"),
    "run: scans.h5": run_scans,
    "run: run.json": lambda: run_file("run.json", misspelled([_run()["run.json"].decode()])),
    "run: metrics.json": lambda: run_file("metrics.json", misspelled([_run()["metrics.json"].decode()])),
    "run: map.yaml": lambda: run_file("map.yaml", misspelled([_run()["map.yaml"].decode()])),
    "run: map.pgm": lambda: run_file("map.pgm", damaged([_run()["map.pgm"]])),
    "run: trajectory.tum": lambda: run_file("trajectory.tum", misspelled([_run()["trajectory.tum"].decode()])),
    "scans .npz": log,
    "weights": weights,
}
