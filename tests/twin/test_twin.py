"""Twins: a simulated recording in place of the real one, simulated again with one error at a time. The figures must be
perfect for the recording itself, and decrease with wrong materials, wrong poses and the wrong place."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from radarize.io.errors import InputError
from radarize.io.recording import Recording, RecordingWriter
from radarize.radar.presets import PRESETS, load_config
from radarsim.motion.trajectory import Mounting
from radarsim.recording.simulate import simulate
from radarsim.twin.comparison import compare
from radarsim.twin.report import report_twin
from radarsim.twin.twin import Options, make_twin
from radarsim.world.materials import MATERIALS
from radarsim.world.scene import Scene
from tests.io.importers.public import captures
from tests.twin.poses import altered, shaken


def room(name: str, x: float, y: float, things: list[dict]) -> Scene:
    """Room of x x y x 2.6 m with objects."""
    walls = [
        ("west", [y, 2.6], [-x / 2, 0, 1.3], [1, 0, 0]), ("east", [y, 2.6], [x / 2, 0, 1.3], [-1, 0, 0]),
        ("south", [x, 2.6], [0, -y / 2, 1.3], [0, 1, 0]), ("north", [x, 2.6], [0, y / 2, 1.3], [0, -1, 0]),
        ("floor", [x, y], [0, 0, 0], [0, 0, 1]), ("ceiling", [x, y], [0, 0, 2.6], [0, 0, -1]),
    ]  # fmt: skip
    objects = [
        {"name": n, "shape": "rectangle", "size": s, "position": p, "facing": f, "material": "plasterboard"}
        for n, s, p, f in walls
    ]
    return Scene.of({"objects": objects + things}, name)


def box(name: str, size: list[float], x: float, y: float, turn: float, material: str) -> dict:
    position, rotation = [x, y, size[2] / 2], [0, 0, turn]
    return {
        "name": name,
        "shape": "box",
        "size": size,
        "position": position,
        "rotation": rotation,
        "material": material,
    }


PLACE = room("place", 5, 4, [
    box("cabinet", [0.5, 1.0, 1.9], 2.1, 0.9, 0, "metal"), box("desk", [0.7, 1.2, 0.8], 1.4, -1.2, 20, "wood"),
    box("shelf", [0.3, 0.9, 2.0], -0.4, 1.6, 75, "chipboard"), box("pillar", [0.3, 0.3, 2.6], 0.9, 0.3, 30, "concrete"),
])  # fmt: skip
ELSEWHERE = room("elsewhere", 6.4, 5.2, [
    box("cabinet", [0.5, 1.0, 1.9], 0.2, -1.1, 60, "metal"), box("desk", [0.7, 1.2, 0.8], -0.5, 1.1, -40, "wood"),
])  # fmt: skip


@pytest.fixture(scope="module")
def real(tmp_path_factory):
    """Recording at five frames per second for two seconds on a curve through the place."""
    folder = tmp_path_factory.mktemp("real")
    _, text = load_config("radarize")
    fields = next(line for line in text.splitlines() if line.startswith("frameCfg")).split()
    slow = " ".join([*fields[:5], "200", *fields[6:]])
    (folder / "slow.cfg").write_text(text.replace(" ".join(fields), slow))
    t = np.arange(0, 3.6, 0.1)
    yaw = 0.7 * np.sin(1.2 * t)
    place = np.stack([-1.8 + 0.6 * t, 0.5 * np.sin(1.06 * t) - 0.4, 1.0 + 0 * t], axis=1)
    quaternions = Rotation.from_euler("z", yaw[:, None]).as_quat()
    np.savetxt(folder / "poses.tum", np.column_stack([t, place, quaternions]))
    return simulate(
        PLACE, folder / "real.h5", trajectory=folder / "poses.tum", radar=str(folder / "slow.cfg"), duration=2.0, seed=3
    )


def medians(found) -> dict[str, float]:
    return {name: float(np.nanmedian(values)) for name, values in found.figures.items()}


@pytest.fixture(scope="module")
def compared(real, tmp_path_factory):
    """Comparisons by the error of the twin."""
    folder = tmp_path_factory.mktemp("twins")
    metal = Scene("place", [replace(thing, material=MATERIALS["metal"]) for thing in PLACE.objects])

    def twin(name, scene=PLACE, recording=real, seed=9):
        return compare(real, make_twin(recording, scene, folder / f"{name}.h5", Options(seed=seed)))

    return {
        "itself": compare(real, real),
        "same seed": twin("same", seed=3),
        "other seed": twin("seed"),
        "materials": twin("materials", metal),
        "3 cm": twin("small", recording=altered(real, folder / "a.h5", shaken(0.03, 1))),
        "10 cm": twin("large", recording=altered(real, folder / "b.h5", shaken(0.1, 4))),
        "elsewhere": twin("elsewhere", ELSEWHERE),
    }


def test_a_recording_is_like_itself(compared):
    found = medians(compared["itself"])
    for name, value in found.items():
        if name.startswith(("correlation", "similarity", "profile_correlation", "bearings")):
            assert value == pytest.approx(1, abs=1e-5), name
        elif not name.startswith("velocity_error"):
            assert value == pytest.approx(0, abs=1e-5), name
    assert all(twin == pytest.approx(0, abs=1e-3) for twin, _ in compared["itself"].frechet.values())


def test_every_error_shows(compared):
    """From the best twin to the worst: different speckle is the smallest error, the wrong place the largest."""
    order = ["itself", "same seed", "other seed", "3 cm", "10 cm", "elsewhere"]
    for name in ("correlation_range_azimuth", "similarity_range_azimuth", "profile_correlation"):
        values = [medians(compared[which])[name] for which in order]
        assert np.all(np.diff(values) < 0), (name, values)
        assert values[2] - medians(compared["materials"])[name] > 0.03, name
    correlation = {which: medians(found)["correlation_range_azimuth"] for which, found in compared.items()}
    assert correlation["other seed"] > 0.85
    assert correlation["elsewhere"] < 0.3
    distance = {which: found.frechet["range_azimuth"][0] for which, found in compared.items()}
    assert distance["other seed"] < 0.5 * distance["materials"]


def test_velocities_follow_the_poses(compared):
    """Speckle, materials and even the place do not affect the velocity; wrong poses do."""
    off = {which: medians(found)["velocity"] for which, found in compared.items()}
    assert max(off["other seed"], off["elsewhere"]) < 0.05 < off["10 cm"]
    errors = medians(compared["10 cm"])
    assert errors["velocity_error_twin"] < 0.05 < errors["velocity_error_recording"]


def test_unrelated_frames_are_the_scale(compared):
    found = compared["other seed"]
    name = "correlation_range_azimuth"
    assert found.chance[name] < 0.5 * medians(found)[name]
    assert medians(compared["elsewhere"])[name] == pytest.approx(found.chance[name], abs=0.25)


def test_the_twin_takes_stamps_and_losses(real, tmp_path):
    """Time stamps of a real clock, lost chirps, and half of the frames."""
    clock = 1.7e9

    def change(poses, file):
        for name in ("radar/time", "truth/time"):
            file[name][:] += clock
        file["radar/valid"][3, 5:9] = False
        return poses

    made = make_twin(altered(real, tmp_path / "real.h5", change), PLACE, tmp_path / "twin.h5", Options(every=2, seed=3))
    lost = make_twin(
        altered(real, tmp_path / "odd.h5", change), PLACE, tmp_path / "odd_twin.h5", Options(every=3, duration=1.2)
    )
    with Recording(tmp_path / "real.h5") as one, Recording(made) as other, Recording(lost) as third:
        assert other.times == pytest.approx(one.times[::2], abs=1e-5)
        assert other.read("truth/time") == pytest.approx(one.read("truth/time")[::2], abs=1e-5)
        assert other.read("truth/pose") == pytest.approx(one.read("truth/pose")[::2], abs=1e-4)
        assert np.array_equal(third.valid(0, 2), one.valid(0, 4)[::3])
        assert not third.adc(1, 2)[0, 5:9].any() and third.adc(1, 2)[0, 9:].any()
        assert len(third) == 2
    assert medians(compare(tmp_path / "real.h5", made))["correlation_range_azimuth"] > 0.8


def test_a_wrong_clock_and_a_wrong_heading_are_reported(real, tmp_path):
    def late(poses, file):
        file["truth/time"][:] += 0.4
        return poses

    def turned(poses, file):
        turn = Rotation.from_quat(poses[:, 3:]) * Rotation.from_euler("z", 9, degrees=True)
        return np.hstack([poses[:, :3], turn.as_quat()])

    first = make_twin(altered(real, tmp_path / "late.h5", late), PLACE, tmp_path / "t.h5", Options(seed=9))
    with Recording(first) as recording:
        assert "2 of 10 frames have no pose" in recording.attributes["warnings"]
    found = compare(tmp_path / "late.h5", first).misfits()
    assert found["time"][0] == pytest.approx(-0.4) and found["time"][1] > 0.1
    second = make_twin(altered(real, tmp_path / "turned.h5", turned), PLACE, tmp_path / "u.h5", Options(seed=9))
    # The twin looks too far to the left, so that all it sees is too far to the right.
    found = compare(real, second).misfits()
    assert np.degrees(found["azimuth"][0]) == pytest.approx(9, abs=1.6) and "time" not in found
    text = report_twin(real, second)[0].read_text()
    assert "heading, the mounting or the scene is turned" in text and "<img" in text
    figures = json.loads((tmp_path / "u.json").read_text())
    assert figures["frames"] == 10 and len(figures["per_frame"]["correlation_range_azimuth"]) == 10
    assert figures["misfits"]["azimuth"]["gain"] > 0.05


def test_poses_of_another_body_in_another_frame(real, tmp_path, compared):
    """Poses of a cart, in its own coordinates, give the same twin if origin and mounting are given."""
    origin, mounting = Mounting.of((3, -2, 0.4), (0, 0, 50)), Mounting.of((0.2, 0.1, 0.5), (0, 10, -30))

    def change(poses, file):
        turn = Rotation.from_quat(poses[:, 3:]) * mounting.rotation.inv()
        place = poses[:, :3] - turn.apply(mounting.lever_arm)
        back = origin.rotation.inv()
        return np.hstack([back.apply(place - origin.lever_arm), (back * turn).as_quat()])

    recording = altered(real, tmp_path / "cart.h5", change)
    made = make_twin(recording, PLACE, tmp_path / "twin.h5", Options(origin=origin, mounting=mounting, seed=3))
    found = medians(compare(recording, made))
    assert found["correlation_range_azimuth"] == pytest.approx(
        medians(compared["same seed"])["correlation_range_azimuth"], abs=0.02
    )


def test_a_board_with_calibration_and_bias(real, tmp_path):
    """The twin's board has the errors that a configuration corrects: range and channels are right."""
    rng = np.random.default_rng(0)
    factors = np.exp(2j * np.pi * rng.random(12))
    with Recording(real) as one:
        config = one.config.model_copy(
            update={"channel_calibration": tuple((f.real, f.imag) for f in factors), "range_bias": 0.09}
        )
        adc, shift = one.adc(0, 10).astype(np.float32), 0.09 / one.config.range_resolution
        signal = adc.view(np.complex64)[..., 0] / factors.reshape(3, 4)[..., None]
        signal = signal * np.exp(2j * np.pi * shift * np.arange(one.config.samples) / one.config.samples)
        raw = np.rint(np.stack([signal.real, signal.imag], axis=-1)).astype(np.int16)
        streams = {name: one.read(name)[:10] for name in ("truth/time", "truth/pose")}
        times = one.times[:10]
    path = tmp_path / "board.h5"
    with RecordingWriter(path, config) as writer:
        writer.append(raw, times)
    with h5py.File(path, "r+") as file:
        for name, rows in streams.items():
            file[name] = rows
    found = compare(path, make_twin(path, PLACE, tmp_path / "twin.h5", Options(seed=9)))
    assert medians(found)["correlation_range_azimuth"] > 0.75 and not found.misfits()


def test_what_is_missing_is_reported_in_a_sentence(real, tmp_path):
    def refused(recording=real, scene=PLACE, **options):
        with pytest.raises(InputError) as caught:
            make_twin(recording, scene, tmp_path / "x.h5", Options(**options))
        assert "\n" not in str(caught.value) and not (tmp_path / "x.h5").exists()
        return str(caught.value)

    def without(name):
        def change(poses, file):
            del file[name]
            return poses

        return altered(real, tmp_path / "without.h5", change)

    assert "--poses FILE.tum, or give the place of a radar at rest with --at" in refused(without("truth/time"))
    assert "lie outside scene place (-2.5...2.5" in refused(origin=Mounting.of((50, 0, 0), (0, 0, 0)))
    assert "expected one of the two" in refused(frontend=tmp_path / "board.yaml", fit=True)
    assert "every is 0" in refused(every=0)
    assert "duration is 0 s, expected more than 0" in refused(duration=0.0)

    def other_clock(poses, file):
        file["truth/time"][:] += 1e6
        return poses

    assert "no frame lies between two of its poses" in refused(altered(real, tmp_path / "clock.h5", other_clock))
    shifted = altered(
        real,
        tmp_path / "shifted.h5",
        lambda poses, file: file["radar/time"].__setitem__(..., file["radar/time"][:] + 1e3) or poses,
    )
    with pytest.raises(InputError, match="has no frame with the stamp of a frame"):
        compare(real, shifted)
    faster = PRESETS["radarize"]
    with RecordingWriter(tmp_path / "faster.h5", faster) as writer:
        writer.append(np.zeros((1, *faster.frame_shape), np.int16), np.zeros(1))
    with pytest.raises(InputError, match="frame_period is 0.0333"):
        compare(real, tmp_path / "faster.h5")


def test_real_captures(recordings, tmp_path):
    """Frames from unknown rooms: without a pose there is an error message; with one, the fitted board has their
    noise."""
    for name, path in captures(recordings, tmp_path).items():
        with pytest.raises(InputError, match="has no poses"):
            make_twin(path, PLACE, tmp_path / "x.h5")
        made = make_twin(
            path, PLACE, tmp_path / f"{name}.twin.h5", Options(at=Mounting.of((-2, 0, 1), (0, 0, 0)), fit=True)
        )
        found = compare(path, made)
        assert medians(found)["noise"] == pytest.approx(0, abs=2.0), name
        page, sentences = report_twin(path, made)
        assert ("single virtual antenna" in " ".join(sentences)) == (name == "pcap")
        assert "Range profiles" in page.read_text()
