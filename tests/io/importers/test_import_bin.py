import itertools
import re
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from radarize.io.errors import InputError
from radarize.io.exporters import export
from radarize.io.importers import Given, capture, import_recording
from radarize.io.recording import Recording, RecordingWriter
from radarize.radar.cfg import parse_cfg, write_cfg
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import encode
from tests.io.importers.test_import_pcap import pcap, udp
from tests.packets import packets

CONFIG = RadarConfig(
    start_frequency=77e9,
    slope=60e12,
    idle_time=20e-6,
    adc_start_time=5e-6,
    ramp_end_time=60e-6,
    samples=32,
    sample_rate=5e6,
    loops=4,
    frame_period=50e-3,
    tx_order=(0, 2, 1),
)
ORDERS = [order for n in (1, 2, 3) for order in itertools.permutations((0, 1, 2), n)]


def room(config: RadarConfig, count: int, seed: int = 0) -> np.ndarray:
    """Frames of a static room: the same echoes in every loop, and some noise."""
    rng = np.random.default_rng(seed)
    loops, tx, rx, samples, _ = config.frame_shape
    bins = rng.uniform(1, samples / 2 - 2, 8)
    gains = rng.normal(size=(tx, rx, 8)) + 1j * rng.normal(size=(tx, rx, 8))
    echoes = 1000 * gains @ np.exp(2j * np.pi * np.outer(bins, np.arange(samples)) / samples)
    signal = echoes + 30 * rng.normal(size=(count, loops, tx, rx, samples, 2)).view(complex)[..., 0]
    return np.stack([signal.real, signal.imag], -1).round().astype(np.int16)


def write_bin(path: Path, frames: np.ndarray, config: RadarConfig, cut: int = 0) -> Path:
    data = encode(frames, config).tobytes()
    path.write_bytes(data[: len(data) - cut])
    return path


@pytest.mark.parametrize("iq_order", ["iiqq", "qqii"])
@pytest.mark.parametrize("order", ORDERS)
def test_import_of_an_export_is_the_recording(tmp_path, order, iq_order):
    config = CONFIG.model_copy(
        update={"tx_order": order, "iq_order": iq_order, "rx": (0, 2) if len(order) == 2 else (1,)}
    )
    frames = room(config, 3)
    with RecordingWriter(tmp_path / "a.h5", config) as writer:
        writer.append(frames, config.frame_period * np.arange(3))
    export(tmp_path / "a.h5", "bin", tmp_path / "out.bin")
    import_recording(tmp_path / "out.bin", tmp_path / "b.h5")
    with Recording(tmp_path / "b.h5") as recording:
        assert recording.config == config
        assert np.array_equal(recording.adc(0, 3), frames)
        assert recording.times == pytest.approx(config.frame_period * np.arange(3))
        assert recording.valid(0, 3).all()
        assert recording.attributes["warnings"] == recording.attributes["assumed"] == ""


def test_batches_do_not_show(tmp_path, monkeypatch):
    frames = room(CONFIG, 7)
    source = write_bin(tmp_path / "a.bin", frames, CONFIG, cut=100)
    monkeypatch.setattr(capture, "BATCH_BYTES", 2 * CONFIG.frame_bytes)
    seen = []
    import_recording(source, tmp_path / "a.h5", Given(CONFIG), progress=lambda done, total: seen.append((done, total)))
    assert seen == [(2, 6), (4, 6), (6, 6)]
    with Recording(tmp_path / "a.h5") as recording:
        assert np.array_equal(recording.adc(0, 6), frames[:6])


@pytest.mark.parametrize("cut", [1, 3, 100, 1456, CONFIG.frame_bytes - 1])
def test_a_truncated_file_keeps_its_whole_frames_and_says_so(tmp_path, cut):
    frames = room(CONFIG, 4)
    source = write_bin(tmp_path / "a.bin", frames, CONFIG, cut=cut)
    import_recording(source, tmp_path / "a.h5", Given(config=CONFIG))
    with Recording(tmp_path / "a.h5") as recording:
        assert np.array_equal(recording.adc(0, 9), frames[:3])
        assert f"3 whole frames and {CONFIG.frame_bytes - cut} bytes" in recording.attributes["warnings"]


def test_less_than_a_frame_is_refused(tmp_path):
    source = write_bin(tmp_path / "a.bin", room(CONFIG, 1), CONFIG, cut=4)
    with pytest.raises(InputError, match=f"has {CONFIG.frame_bytes - 4} bytes, less than one frame; .*32 samples"):
        import_recording(source, tmp_path / "a.h5", Given(config=CONFIG))
    (tmp_path / "empty.bin").touch()
    with pytest.raises(InputError, match="has 0 bytes"):
        import_recording(tmp_path / "empty.bin", tmp_path / "a.h5", Given(config=CONFIG))
    assert not (tmp_path / "a.h5").exists()


@pytest.mark.parametrize("samples", [30, 34, 40, 48])
def test_a_wrong_sample_count_is_refused_with_both_sizes(tmp_path, samples):
    source = write_bin(tmp_path / "a.bin", room(CONFIG, 9), CONFIG)
    wrong = CONFIG.model_copy(update={"samples": samples})
    if source.stat().st_size % wrong.frame_bytes == 0:  # nothing is left over: imported with a warning
        import_recording(source, tmp_path / "a.h5", Given(config=wrong))
        with Recording(tmp_path / "a.h5") as recording:
            assert "repeat every 384" in recording.attributes["warnings"]
        return
    with pytest.raises(InputError, match=rf"repeat every 384 and not every {12 * samples} \(TX x RX x samples\)"):
        import_recording(source, tmp_path / "a.h5", Given(config=wrong))


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("packed", [False, True])
def test_one_transmitter_for_several_is_noticed(tmp_path, count, packed):
    config = CONFIG.model_copy(update={"tx_order": (0, 1, 2)[:count]})
    wrong = config.model_copy(update={"tx_order": (0,), "loops": count * config.loops})
    frames = room(config, 3)
    source = write_bin(tmp_path / "a.bin", frames, config)
    if packed:
        source = pcap(tmp_path / "a.pcap", [udp(packet.encode()) for packet in packets(source.read_bytes())])
    import_recording(source, tmp_path / "a.h5", Given(config=wrong))
    with Recording(tmp_path / "a.h5") as recording:
        assert f"repeat every {128 * count} and not every 128 (TX x RX x samples)" in recording.attributes["warnings"]


def test_odd_sample_counts_are_refused(tmp_path):
    source = write_bin(tmp_path / "a.bin", room(CONFIG, 2), CONFIG)
    with pytest.raises(InputError, match="samples is 31, expected an even number"):
        import_recording(source, tmp_path / "a.h5", Given(config=CONFIG, overrides={"samples": 31}))


def test_zero_filled_chirps_are_marked(tmp_path):
    frames = room(CONFIG, 2)
    frames[1, 2, 1] = 0  # TX2 of the third loop
    import_recording(write_bin(tmp_path / "a.bin", frames, CONFIG), tmp_path / "a.h5", Given(config=CONFIG))
    with Recording(tmp_path / "a.h5") as recording:
        valid = recording.valid(0, 2)
        assert not valid[1, 2, 1] and valid.sum() == valid.size - 1


def test_a_wrong_iq_order_is_noticed(tmp_path):
    source = write_bin(tmp_path / "a.bin", room(CONFIG, 2), CONFIG)
    import_recording(source, tmp_path / "a.h5", Given(config=CONFIG.model_copy(update={"iq_order": "iiqq"})))
    with Recording(tmp_path / "a.h5") as recording:
        assert "the samples look like qqii" in recording.attributes["warnings"]


@pytest.mark.parametrize("iq_order", ["iiqq", "qqii"])
def test_without_a_configuration(tmp_path, iq_order):
    config = CONFIG.model_copy(update={"iq_order": iq_order, "tx_order": (0, 1)})
    frames = room(config, 2)
    source = write_bin(tmp_path / "a.bin", frames, config)
    with pytest.raises(InputError, match=r"no radar configuration.*missing: loops, rx"):
        import_recording(source, tmp_path / "a.h5", Given(overrides={"samples": 32}))
    given = {"samples": 32, "loops": 4, "rx": 4, "tx": 2, "slope": 70e12, "board": None}
    import_recording(source, tmp_path / "a.h5", Given(overrides=given, start_time=5.0))
    with Recording(tmp_path / "a.h5") as recording:
        assert np.array_equal(recording.adc(0, 2), frames)
        assert recording.config.iq_order == iq_order
        assert recording.config.slope == 70e12
        assert recording.times[0] == 5.0
        assumed = recording.attributes["assumed"].split(", ")
        assert "start_frequency" in assumed and "iq_order" in assumed and "slope" not in assumed


@pytest.mark.parametrize(
    "given, message",
    [
        ({"samples": -2}, "samples is -2"),
        ({"samples": "many"}, "samples is 'many'"),
        ({"rx": 0}, "rx"),
        ({"rx": 5}, "rx is"),
        ({"tx": 4}, "tx is 4"),
        ({"iq_order": "iqiq"}, "iq_order is 'iqiq'"),
        ({"sample_rate": 0}, "sample_rate is 0"),
        ({"frame_period": 1e-6}, "frame_period is 0.001 ms"),
        ({"colour": 1}, "colour is 1"),
    ],
)
def test_impossible_overrides_are_named(tmp_path, given, message):
    source = write_bin(tmp_path / "a.bin", room(CONFIG, 2), CONFIG)
    for config in (CONFIG, None):
        with pytest.raises(InputError) as error:
            import_recording(
                source, tmp_path / "a.h5", Given(config=config, overrides={"samples": 32, "loops": 4, "rx": 4} | given)
            )
        assert message in str(error.value)


def test_cfg_of_the_same_name_is_used_and_kept(tmp_path):
    frames = room(CONFIG, 2)
    write_bin(tmp_path / "a.bin", frames, CONFIG)
    text = "% mine\n" + write_cfg(CONFIG)
    (tmp_path / "a.cfg").write_text(text)
    import_recording(tmp_path / "a.bin", tmp_path / "a.h5")
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.cfg_text == text
        assert parse_cfg(recording.cfg_text) == recording.config == CONFIG


@pytest.mark.parametrize("name", ["missing.bin", "a.wav", "a.h5"])
def test_sources_that_are_none(tmp_path, name):
    (tmp_path / "a.wav").write_bytes(b"RIFF" + bytes(100))
    (tmp_path / "a.h5").write_bytes(b"\x89HDF" + bytes(100))
    with pytest.raises(InputError, match=name):
        import_recording(tmp_path / name, tmp_path / "a.h5", Given(config=CONFIG))


# --- poses -----------------------------------------------------------------------------------------------------------
def test_poses_come_along(tmp_path):
    source = write_bin(tmp_path / "a.bin", room(CONFIG, 2), CONFIG)
    (tmp_path / "p.tum").write_text("# time x y z qx qy qz qw\n0 1 2 3 0 0 0 1\n\n0.05 1.1 2 3 0 0 0.6 0.8\n")
    import_recording(source, tmp_path / "a.h5", Given(config=CONFIG, poses=tmp_path / "p.tum"))
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.read("truth/time") == pytest.approx([0, 0.05])
        assert recording.read("truth/pose") == pytest.approx(
            np.array([[1, 2, 3, 0, 0, 0, 1], [1.1, 2, 3, 0, 0, 0.6, 0.8]])
        )
    export(tmp_path / "a.h5", "tum", tmp_path / "q.tum")
    assert np.loadtxt(tmp_path / "q.tum") == pytest.approx(np.loadtxt(tmp_path / "p.tum"))


def test_poses_of_another_clock_are_noticed(tmp_path):
    source = write_bin(tmp_path / "a.bin", room(CONFIG, 2), CONFIG)
    (tmp_path / "p.tum").write_text("1700000000 1 2 3 0 0 0 1\n1700000009 1 2 3 0 0 0 1\n")
    for start, warned in ((0.0, True), (1700000001.0, False)):
        import_recording(source, tmp_path / "a.h5", Given(config=CONFIG, poses=tmp_path / "p.tum", start_time=start))
        with Recording(tmp_path / "a.h5") as recording:
            assert ("give start_time" in recording.attributes["warnings"]) == warned


@pytest.mark.parametrize(
    "text, message",
    [
        ("", "holds no poses"),
        ("0 1 2 3 0 0 0", "line 1: .*eight numbers"),
        ("0 1 2 3 0 0 0 1 9", "line 1: .*eight numbers"),
        ("0 1 2 3 0 0 0 1\n1 a 2 3 0 0 0 1", "line 2: .*eight numbers"),
        ("0 nan 2 3 0 0 0 1", "line 1: .*expected finite numbers"),
        ("0 1 2 3 0 0 0 inf", "expected finite numbers"),
        ("1 1 2 3 0 0 0 1\n1 1 2 3 0 0 0 1", "line 2: .*ascending"),
        ("0 1 2 3 0 0 0 0.9", "line 1: .*length 0.9"),
        ("\x00\xff\x00", "eight numbers"),
    ],
)
def test_bad_poses_are_refused_before_anything_is_written(tmp_path, text, message):
    source = write_bin(tmp_path / "a.bin", room(CONFIG, 2), CONFIG)
    (tmp_path / "p.tum").write_text(text, encoding="latin-1")
    with pytest.raises(InputError, match=message):
        import_recording(source, tmp_path / "a.h5", Given(config=CONFIG, poses=tmp_path / "p.tum"))
    assert not list(tmp_path.glob("*.h5*"))


# --- parts -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("part", [0, 1, 2])
def test_parts_of_a_capture_are_joined(tmp_path, part):
    """Eleven parts, cut within a word; the number 10 sorts after 9."""
    frames = room(CONFIG, 6)
    data = encode(frames, CONFIG).tobytes()
    cuts = np.linspace(0, len(data), 12).astype(int) | 1
    cuts[0], cuts[-1] = 0, len(data)
    for k, (start, stop) in enumerate(itertools.pairwise(cuts)):
        (tmp_path / f"adc_Raw_{k}.bin").write_bytes(data[start:stop])
    (tmp_path / "adc.cfg").write_text(write_cfg(CONFIG))
    import_recording(tmp_path / f"adc_Raw_{part}.bin", tmp_path / "a.h5")
    with Recording(tmp_path / "a.h5") as recording:
        assert np.array_equal(recording.adc(0, 6), frames)
    (tmp_path / "adc_Raw_4.bin").unlink()
    with pytest.raises(InputError, match="expected part 4 too"):
        import_recording(tmp_path / "adc_Raw_0.bin", tmp_path / "a.h5")


def test_memory_does_not_grow_with_the_file(tmp_path, monkeypatch):
    monkeypatch.setattr(capture, "BATCH_BYTES", 64 * CONFIG.frame_bytes)
    peaks = []
    for count in (512, 2048):
        source = write_bin(tmp_path / "a.bin", np.tile(room(CONFIG, 4), (count // 4, 1, 1, 1, 1, 1)), CONFIG)
        tracemalloc.start()
        import_recording(source, tmp_path / "a.h5", Given(config=CONFIG))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.1 * peaks[0]


def quiet(count: int = 3) -> np.ndarray:
    """Frames with the level of real ones, far below full scale."""
    return np.random.default_rng(1).normal(0, 200, (count, *CONFIG.frame_shape)).astype(np.int16)


@pytest.mark.parametrize(
    ("written", "words"),
    [
        (lambda raw: (raw.astype(np.int32) + 2**15).astype("<u2").tobytes(), "use --encoding offset-binary"),
        (lambda raw: raw.astype("<f8").tobytes(), r"floating-point numbers \(complex128\)"),
        (lambda raw: (raw / 7).astype("<f4").tobytes(), r"floating-point numbers \(complex64\)"),
        (lambda raw: raw.tobytes(), None),
        (lambda raw: np.random.default_rng(2).bytes(raw.nbytes), None),  # full scale, but of both signs
    ],
)
def test_captures_that_are_plainly_something_else(tmp_path, written, words):
    (tmp_path / "a.bin").write_bytes(written(encode(quiet(), CONFIG)))
    with Recording(import_recording(tmp_path / "a.bin", tmp_path / "a.h5", Given(CONFIG))) as recording:
        assert bool(re.search("are probably|near full scale", recording.attributes["warnings"])) == bool(words)
        assert re.search(words or "", recording.attributes["warnings"])


def test_offset_binary(tmp_path):
    (tmp_path / "a.bin").write_bytes((encode(quiet(), CONFIG).astype(np.int32) + 2**15).astype("<u2").tobytes())
    given = Given(CONFIG, encoding="offset-binary")
    with Recording(import_recording(tmp_path / "a.bin", tmp_path / "a.h5", given)) as recording:
        assert np.array_equal(recording.adc(0, 3), quiet()) and recording.attributes["warnings"] == ""
    with pytest.raises(InputError, match="is no .bin, but encoding is offset-binary"):
        np.save(tmp_path / "a.npy", quiet())
        import_recording(tmp_path / "a.npy", tmp_path / "b.h5", given)


def test_an_assumed_single_chirp_per_loop_is_a_warning(tmp_path):
    (tmp_path / "a.bin").write_bytes(encode(quiet(), CONFIG).tobytes())
    counts = {"samples": CONFIG.samples, "loops": CONFIG.loops * 3, "rx": 4}
    for more, warned in (({}, True), ({"tx": 1}, False)):
        given = Given(overrides=counts | more)
        with Recording(import_recording(tmp_path / "a.bin", tmp_path / "a.h5", given)) as recording:
            assert ("all speeds are doubled" in recording.attributes["warnings"]) == warned
