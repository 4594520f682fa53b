"""Arrays of samples: every order of axes, every file format, and real captures."""

import itertools
import tracemalloc
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from radarize.io.errors import InputError
from radarize.io.importers import Given, import_recording
from radarize.io.recording import Recording
from tests.io.importers.test_import_bin import CONFIG, room

FRAMES = room(CONFIG, 3)  # (frame 3, loop 4, tx 3, rx 4, sample 32, iq)
CUBE = FRAMES[..., 0] + 1j * FRAMES[..., 1].astype(np.float32)


def imported(path: Path, **more) -> np.ndarray:
    with Recording(import_recording(path, path.with_name("out.h5"), Given(**({"config": CONFIG} | more)))) as recording:
        return recording.adc(0, len(recording))


def matlab73(path: Path, values: np.ndarray) -> Path:
    """Write an array as MATLAB version 7.3: HDF5 with reversed axes, complex entries as pairs."""
    pairs = np.empty(values.T.shape, [("real", "<f4"), ("imag", "<f4")])
    pairs["real"], pairs["imag"] = values.T.real, values.T.imag
    with h5py.File(path, "w", userblock_size=512) as file:
        file["adc"] = pairs
        file["fs"] = np.zeros((1, 1))
    return path


@pytest.mark.parametrize("kind", ["npy", "npy pairs", "npy fortran", "npz", "npz packed", "mat 5", "mat 7.3"])
def test_formats(tmp_path, kind):
    path = tmp_path / f"a.{kind.split()[0]}"
    if kind == "npy pairs":
        np.save(path, FRAMES)
    elif kind.startswith("npy"):
        np.save(path, np.asfortranarray(CUBE) if "fortran" in kind else CUBE)
    elif kind.startswith("npz"):
        (np.savez_compressed if "packed" in kind else np.savez)(path, time=np.arange(3), adc=CUBE)
    elif kind == "mat 5":
        savemat(path, {"adc": CUBE, "fs": 5e6})
    else:
        matlab73(path, CUBE)
    assert np.array_equal(imported(path), FRAMES)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([path.name, "out.h5"])  # nothing unpacked is left


@settings(max_examples=30, deadline=None)
@given(st.permutations(range(5)), st.booleans())
def test_axes_in_any_order(tmp_path_factory, order, pairs):
    names = [("frame", "loop", "tx", "rx", "sample")[k] for k in order]
    path = tmp_path_factory.mktemp("axes") / "a.npy"
    if pairs:
        place = order[0]  # anywhere
        np.save(path, np.moveaxis(FRAMES.transpose(*order, 5), -1, place))
        names.insert(place, "iq")
    else:
        np.save(path, CUBE.transpose(order))
    assert np.array_equal(imported(path, shape=",".join(names)), FRAMES)


def test_joined_and_fired_axes(tmp_path):
    """The firing order is TX1, TX3, TX2."""
    path = tmp_path / "a.npy"
    np.save(path, CUBE.reshape(3, 4, 12, 32))
    assert np.array_equal(imported(path, shape="frame,loop,virtual,sample"), FRAMES)
    fired = CUBE[:, :, [0, 2, 1]]
    np.save(path, fired.reshape(3, 12, 4, 32))
    assert np.array_equal(imported(path, shape="frame,chirp,rx,sample"), FRAMES)
    np.save(path, fired.transpose(1, 2, 0, 3, 4))
    assert np.array_equal(imported(path, shape="loop,slot,frame,rx,sample"), FRAMES)
    np.save(path, FRAMES[..., ::-1])
    assert np.array_equal(imported(path, shape="frame,loop,tx,rx,sample,qi"), FRAMES)
    np.save(path, CUBE[1])
    assert np.array_equal(imported(path, shape="loop,tx,rx,sample"), FRAMES[1:2])
    np.save(path, CUBE.reshape(-1))
    assert np.array_equal(imported(path, shape="3,4,3,4,32"), FRAMES)
    np.save(path, FRAMES.reshape(-1))
    assert np.array_equal(imported(path, shape="3,4,3,4,32,2"), FRAMES)


def test_without_a_configuration(tmp_path):
    """Lengths come from the array; exchanged I and Q are found from the samples."""
    np.save(tmp_path / "a.npy", CUBE.imag + 1j * CUBE.real)
    out = import_recording(tmp_path / "a.npy", tmp_path / "a.h5")
    with Recording(out) as recording:
        assert recording.config.frame_shape == CONFIG.frame_shape
        assert np.array_equal(recording.adc(0, 3), FRAMES)
        assert recording.attributes["found"].startswith("iq_order iiqq (")
        assert "slope" in recording.attributes["assumed"]
    import_recording(tmp_path / "a.npy", tmp_path / "a.h5", Given(overrides={"iq_order": "qqii"}))
    with Recording(out) as recording:
        assert np.array_equal(recording.adc(0, 3), FRAMES[..., ::-1])
        assert "found" not in recording.attributes


def test_the_people_of_a_public_capture(recordings, tmp_path):
    """Two people at 2.93 m, one approaching, one receding, and a static object at 5.22 m (samples as unsigned
    words)."""
    given = {"tx": (0, 2), "start_frequency": 77e9, "slope": 60.012e12, "sample_rate": 2.5e6, "idle_time": 30e-6,
             "ramp_end_time": 62e-6, "adc_start_time": 6e-6}  # fmt: skip
    source = recordings / "xwr-moving-people" / "doppler_example_1.npy"
    with Recording(
        import_recording(source, tmp_path / "a.h5", Given(shape="loop,virtual,sample", overrides=given))
    ) as recording:
        config, adc = recording.config, recording.adc(0, 1)[0].astype(float)
    assert config.frame_shape == (128, 2, 4, 128, 2)
    signal = (adc[..., 0] + 1j * adc[..., 1]) * np.hanning(128)
    profile = np.fft.fft(signal * np.hanning(128)[:, None, None, None], axis=-1)
    spectrum = np.abs(np.fft.fftshift(np.fft.ifft(profile, axis=0), axes=0)) ** 2  # closing speeds ascend
    power = spectrum.mean(axis=(1, 2))
    speeds = (np.arange(128) - 64) * config.velocity_resolution
    near = lambda metres: int(round(metres / config.range_resolution))  # noqa: E731
    still = power[np.abs(speeds) < 0.1].sum(axis=0)
    assert abs(20 + still[20:].argmax() - near(5.22)) <= 1
    people = power[:, near(2.93) - 1 : near(2.93) + 2].max(axis=1)
    for low, high in ((0.4, 0.8), (-0.9, -0.4)):
        beside = (np.abs(speeds) > 1.2) & (np.abs(speeds) < 2)
        assert people[(speeds > low) & (speeds < high)].max() > 10 * np.median(people[beside])


def test_values_that_are_no_counts(tmp_path):
    path = tmp_path / "a.npy"
    np.save(path, CUBE / 32768)
    with Recording(import_recording(path, tmp_path / "a.h5", Given(config=CONFIG))) as recording:
        scale = recording.attributes["counts_per_unit"]
        assert recording.adc(0, 3) == pytest.approx(FRAMES * scale / 32768, abs=0.51)
        assert abs(recording.adc(0, 3)).max() == 8192
    loud = CUBE * 1000
    np.save(path, np.rint(loud))
    with Recording(import_recording(path, tmp_path / "a.h5", Given(config=CONFIG))) as recording:
        assert "values exceed 16 bits" in recording.attributes["warnings"]
    holed = CUBE.copy()
    holed[1, 2, 1, 0, 7] = np.nan
    holed[2, 0, 0] = 0
    np.save(path, holed)
    with Recording(import_recording(path, tmp_path / "a.h5", Given(config=CONFIG))) as recording:
        lost = np.argwhere(~recording.valid(0, 3))
        assert lost.tolist() == [[1, 2, 1], [2, 0, 0]]


def test_memory_does_not_grow_with_the_array(tmp_path, monkeypatch):
    """Four times as many frames need at most a fifth more memory, for any order of axes."""
    monkeypatch.setattr("radarize.io.importers.capture.BATCH_BYTES", 4 * CONFIG.frame_bytes)
    for packed, shape in itertools.product((False, True), ("frame,loop,tx,rx,sample", "loop,tx,rx,sample,frame")):
        peaks = []
        for frames in (64, 256):
            many = np.tile(CUBE[:1].astype(np.complex64), (frames, 1, 1, 1, 1))
            many = many if shape.startswith("frame") else np.moveaxis(many, 0, -1)
            (np.savez_compressed if packed else np.savez)(tmp_path / "a.npz", many)
            del many
            tracemalloc.start()
            import_recording(tmp_path / "a.npz", tmp_path / "a.h5", Given(config=CONFIG, shape=shape))
            peaks.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
        assert peaks[1] < 1.2 * peaks[0]


@pytest.mark.parametrize(
    ("values", "more", "message"),
    [
        (CUBE[0], {}, "has shape .* expected the option shape to name"),
        (CUBE, {"shape": "frame,loop,tx,rx"}, "shape is 'frame,loop,tx,rx', expected names"),
        (CUBE, {"shape": "frame,loop,loop,rx,sample"}, "expected names of axes, each once"),
        (CUBE, {"shape": "frame,chirp,tx,rx,sample"}, "expected names of axes, each once"),
        (CUBE, {"shape": "frame,loop,virtual,sample"}, "expected 4 axes"),
        (CUBE, {"shape": "9,4,3,4,32"}, "expected the 13824 of shape"),
        (CUBE[..., :30], {}, r"has sample 30 .*expected sample 32"),
        (CUBE.real, {}, "has shape"),
        (CUBE.real, {"shape": "frame,loop,tx,rx,sample"}, "holds float32 .*expected complex"),
        (FRAMES[..., :1], {}, "expected complex samples, or real ones with an axis iq of 2"),
        (CUBE[:0], {}, "at least one frame"),
        (np.array([["a"]]), {}, "expected numbers"),
        (np.array([{}, []], object), {}, "expected numbers"),
        (CUBE.reshape(3, 4, 12, 32), {"shape": "frame,loop,virtual,sample", "config": None}, "expected rx to be given"),
    ],
)
def test_refusals(tmp_path, values, more, message):
    np.save(tmp_path / "a.npy", values)
    with pytest.raises(InputError, match=message):
        imported(tmp_path / "a.npy", **more)
    assert not (tmp_path / "out.h5").exists()


def test_files_that_are_no_arrays(tmp_path):
    np.save(tmp_path / "good.npy", CUBE)
    cut = (tmp_path / "good.npy").read_bytes()[:5000]
    with zipfile.ZipFile(tmp_path / "wrong.npz", "w") as archive:
        archive.writestr("adc.npy", b"nothing")
    (tmp_path / "a.npy").write_bytes(cut)
    for name in ("x.npy", "x.npz", "x.mat"):
        (tmp_path / name).write_bytes(b"\x93NUMPYrubbish" * 20)
    for name in ("a.npy", "x.npy", "x.npz", "x.mat", "wrong.npz"):
        with pytest.raises(InputError, match=name):
            imported(tmp_path / name)
    np.savez(tmp_path / "two.npz", a=CUBE, b=CUBE)
    with pytest.raises(InputError, match="has arrays a 3x4x3x4x32, b 3x4x3x4x32, expected one of samples, or its name"):
        imported(tmp_path / "two.npz")
    with pytest.raises(InputError, match="expected one called c"):
        imported(tmp_path / "two.npz", variable="c")
    assert np.array_equal(imported(tmp_path / "two.npz", variable="b"), FRAMES)


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=200), st.sampled_from(["npy", "npz", "mat"]))
def test_rubbish_is_one_sentence(tmp_path_factory, data, suffix):
    path = tmp_path_factory.mktemp("rubbish") / f"a.{suffix}"
    path.write_bytes({"npy": b"\x93NUMPY\x01\x00", "npz": b"PK\x03\x04", "mat": b"MATLAB 5.0"}[suffix] + data)
    with pytest.raises(InputError):
        imported(path)
