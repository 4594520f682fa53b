"""Fuzzing of captures: configurations, poses, packets, samples."""

import json
import tempfile
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
from hypothesis import strategies as st
from scipy.io import savemat

import radarize.io.importers.bag  # noqa: F401 -- imported at first use, and what its libraries take is no input's memory
from radarize.io.errors import InputError
from radarize.io.importers import import_recording
from radarize.io.tum import read_tum
from radarize.radar.assembler import FrameAssembler
from radarize.radar.cfg import write_cfg
from radarize.radar.dca1000 import decode, encode
from radarize.radar.dca1000_commands import Opcode, Reply, Request, Status, packet_settings, read_packet_settings
from radarize.radar.limits import check_limits
from radarize.radar.presets import PRESETS, load_config
from tests.fuzzing.damage import damaged, misspelled
from tests.fuzzing.reader import CONFIG, CUBE, FRAMES, RECORDINGS, Reader, file, importing, use
from tests.io.importers.test_import_pcap import pcap, pcapng, udp
from tests.packets import packets


def cfg() -> Reader:
    """SDK configurations."""

    def read(path: Path) -> None:
        config, _ = load_config(path)
        check_limits(config)
        write_cfg(config)

    texts = [path.read_text() for path in sorted(RECORDINGS.rglob("*.cfg"))]
    texts += [write_cfg(config) for config in PRESETS.values()]
    return Reader(misspelled(texts), file("profile.cfg"), read)


def studio() -> Reader:
    """mmWave Studio folder: settings or setup damaged, the samples intact."""
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
    """Settings that fit `CONFIG`, based on the public capture, or minimal ones without it."""
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
    """TUM trajectories."""
    lines = "\n".join(f"{0.1 * k:.3f} {k} 0 1.2 0 0 0 1" for k in range(20))
    return Reader(misspelled([f"# time x y z qx qy qz qw\n{lines}\n"]), file("poses.tum"), read_tum)


def udp_packets() -> Reader:
    """Data packets of a DCA1000, its commands, replies and settings."""
    sound = [packet.encode() for packet in packets(encode(FRAMES, CONFIG).tobytes())]
    others = [
        Request(Opcode.ALIVE).encode(),
        Request(Opcode.PACKETS, packet_settings()).encode(),
        packet_settings(),
    ]
    others += [Reply(Opcode.STATUS, Status.MEMORY_FULL).encode()]

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
    """Network capture (pcap) of the stream."""
    with tempfile.TemporaryDirectory() as folder:
        stream = [udp(packet.encode()) for packet in packets(encode(FRAMES, CONFIG).tobytes())]
        seeds = [pcap(Path(folder) / "a", stream).read_bytes(), pcap(Path(folder) / "b", stream, ">").read_bytes()]
        seeds.append(pcapng(Path(folder) / "c", stream).read_bytes())
    seeds += [path.read_bytes() for path in sorted((RECORDINGS / "iwr1843-pcap").glob("*.pcap"))]
    return Reader(damaged(seeds), file("a.pcap"), importing())


def raw_words() -> Reader:
    """A .bin, with given settings that need not fit it."""
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
        importing(config=CONFIG if configured else None, overrides=overrides)(path)

    return Reader(st.tuples(damaged([seed]), given, st.booleans()), place, read, lambda what: len(what[0]))


def arrays(kind: str) -> Reader:
    """npy, npz or mat files, in all storage formats."""
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
    given, found = importing(shape="frame,loop,tx,rx,sample,iq" if kind == "npy" else None), importing(config=None)
    inputs = damaged(seeds)
    return Reader(inputs, file(f"a.{kind}"), lambda path: (given if path.stat().st_size % 2 else found)(path))


def _matlab73(path: Path, version: str) -> None:
    pairs = np.empty(CUBE.T.shape, [("real", "<f4"), ("imag", "<f4")])
    pairs["real"], pairs["imag"] = CUBE.T.real, CUBE.T.imag
    with h5py.File(path, "w", userblock_size=512, libver=version) as file:
        file["adc"] = pairs
        file["fs"] = np.zeros((1, 1))
