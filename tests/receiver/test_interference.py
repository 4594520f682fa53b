"""Interference, against both waveforms multiplied in small steps and against closed forms."""

import json

import numpy as np
import pytest

from benchmarks.references.interferers import CASES, CONFIG, FAR, IDEAL, brute_force, facing, scenario
from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.radar.array import rx_positions
from radarize.radar.config import SPEED_OF_LIGHT
from radarize.radar.presets import PRESETS
from radarize.signal.disturbance import find_flaws
from radarsim.motion.trajectory import Motion
from radarsim.receiver.frontend_config import Band, FrontEndConfig
from radarsim.recording.simulate import simulate
from radarsim.scenario import Scenario
from radarsim.world.scene import Scene


def signal(*others: dict, time: float = 0.0, **changes) -> np.ndarray:
    """Interference in a frame: (loop, tx, rx, sample)."""
    made = scenario(*others, **changes)
    return made.interference(made.motion, time)


@pytest.mark.parametrize("name", CASES)
def test_samples_are_those_of_the_waveforms_product(name):
    other, changes = CASES[name]
    made = scenario(other, **changes)
    found = made.interference(made.motion, CONFIG.frame_period)
    heard = np.abs(found).max(axis=(2, 3))
    loop, tx = np.unravel_index(heard.argmax(), heard.shape)
    expected = brute_force(made, CONFIG.frame_period, loop, tx, rx=2)
    assert np.abs(expected).max() > 1e-5
    assert np.abs(found[loop, tx, 2] - expected).max() < 5e-3 * np.abs(expected).max()


# --- level -----------------------------------------------------------------------------------------------------------
BOTH = 2 * 10.5  # dBi of two boards that look at each other
GHOST = {"start": 8e-9}  # its chirps begin as ours do, but for a beat within the band


@pytest.mark.parametrize(
    ("distance", "bearing", "gains"), [(1, 0, BOTH), (4, 0, BOTH), (4, 28, BOTH - 3), (2, -50, BOTH - 6)]
)
def test_power_is_friis(distance, bearing, gains):
    """P G G' (lambda / 4 pi d)^2 with both patterns, relative to the transmitted power, and reduced by the back-off."""
    board = FrontEndConfig.ideal(band=Band(), antenna=FrontEndConfig.of(CONFIG.board).antenna)
    for backoff in (0, 6):
        radar = {"loops": 8, "tx_backoff_db": backoff}
        found = signal(facing(distance, bearing, radar=radar, **GHOST), front_end=board)
        expected = gains - backoff + 20 * np.log10(CONFIG.wavelength / (4 * np.pi * distance))
        assert 20 * np.log10(np.abs(found[..., 30:60]).mean()) == pytest.approx(expected, abs=0.05)


def test_boards_that_look_away_do_not_hear():
    assert not signal(facing(3, 0, yaw=0, **GHOST)).any()
    assert not signal(facing(3, 180, **GHOST)).any()


@pytest.mark.parametrize("difference", [0.5e12, 2e12, 10e12, -30e12])
def test_energy_of_a_crossing(difference):
    """A chirp has the energy |H|^2 df / |S - S'| at each frequency, even if it is shorter than a sample."""
    slope = CONFIG.slope - difference
    early = 25e-6 * difference / slope  # so that they cross in the middle of the window
    board = FrontEndConfig.ideal(band=Band(low=-0.03, high=0.96))  # nothing folds
    found = signal(facing(3, radar={"slope": slope, "loops": 8}, start=-early), front_end=board)[3, 1, 0]
    passed = CONFIG.sample_rate * (0.03 / 3 + 0.9 + 0.06 / 3)  # of the trapezoid's square
    amplitude = SPEED_OF_LIGHT / (77e9 + slope * CONFIG.adc_center_time) / (4 * np.pi * 3)
    energy = amplitude**2 * passed / abs(difference) * CONFIG.sample_rate
    assert np.sum(np.abs(found) ** 2) == pytest.approx(energy, rel=0.01)


def test_duration_of_a_crossing():
    """IF bandwidth over slope difference gives the number of disturbed samples."""
    difference = 0.25e12
    found = np.abs(signal(facing(3, radar={"slope": CONFIG.slope - difference, "loops": 8}, start=-75e-9))[0, 0, 0])
    half = CONFIG.sample_rate * (0.03 + 0.975)  # between the points of half the amplitude
    heard = np.count_nonzero(found > 0.5 * np.median(found[found > 0.7 * found.max()]))
    assert heard / CONFIG.sample_rate == pytest.approx(half / difference, abs=1.1 / CONFIG.sample_rate)


# --- place -----------------------------------------------------------------------------------------------------------
def ghost_range(found: np.ndarray) -> float:
    """Range of the strongest tone, m."""
    window = np.hanning(CONFIG.samples)
    return np.abs(np.fft.fft(found * window, 64 * CONFIG.samples)).argmax() / 64 * CONFIG.range_resolution


def test_like_chirps_make_a_ghost():
    """A chirp of equal slope gives a ghost at half the delay between the chirps; it drifts with the clock error."""
    for start, distance in ((5e-9, 1.0), (-2e-9, 3.0)):
        found = signal(facing(distance, start=start))
        expected = (SPEED_OF_LIGHT * start + distance) / 2
        assert ghost_range(found[2, 1, 0]) == pytest.approx(expected, abs=0.01)
    slow = facing(1.0, start=5e-9, clock_ppm=-0.02)
    late = 30 * CONFIG.frame_period
    drift = ghost_range(signal(slow, time=late)[0, 0, 0]) - ghost_range(signal(slow)[0, 0, 0])
    assert drift == pytest.approx(SPEED_OF_LIGHT * 0.02e-6 * late / 2, abs=0.01)


@pytest.mark.parametrize("bearing", [-40, -10, 25, 60])
@pytest.mark.parametrize(
    ("fields", "crossing"),
    [(GHOST, CONFIG.adc_center_time), ({"start": -0.4e-6, "radar": {"slope": 78e12, "loops": 8}}, 16e-6)],
)
def test_direction_is_the_others_bearing(bearing, fields, crossing):
    """Its phase over the receivers is that of an echo from the interferer's direction at the crossing frequency: left
    is left."""
    found = signal(facing(6, bearing, **fields))
    turn = np.angle(np.vdot(found[..., :-1, :], found[..., 1:, :])) / (2 * np.pi)
    wavelength = SPEED_OF_LIGHT / (CONFIG.start_frequency + CONFIG.slope * crossing)
    assert np.rad2deg(np.arcsin(-turn * wavelength / rx_positions(CONFIG)[1, 1])) == pytest.approx(bearing, abs=0.3)


def test_it_comes_in_by_the_receivers():
    """Its level and phase do not depend on the active transmitter; receivers' errors are included."""
    board = FrontEndConfig.ideal(band=Band(), mismatch={"gain_db": 6, "phase_deg": 90})
    made = scenario(facing(3, **GHOST), front_end=board)
    counts = made.board.receive(made.interference(made.motion, 0.0), np.random.default_rng(0))
    plain = signal(facing(3, **GHOST)) * made.board.scale
    factor = counts[..., 40] / plain[..., 40]
    assert np.allclose(factor, factor[:1, :1], rtol=1e-4) and np.ptp(np.abs(factor[0, 0])) > 0.1


# --- obstacles -------------------------------------------------------------------------------------------------------
def wall(material: str) -> dict:
    return {"name": "wall", "shape": "box", "size": [0.006, 4, 4], "position": [2, 0, 0], "material": material}


def test_walls_stand_in_the_way():
    """Metal blocks it, glass transmits part of it, and a person who walks by blocks it for a while."""
    other = facing(4, **GHOST)
    free = np.abs(signal(other)).max()
    assert not signal(other, objects=[wall("metal")]).any()
    assert 0.05 < np.abs(signal(other, objects=[wall("glass")])).max() / free < 0.95
    walker = {"kind": "person", "name": "x", "path": [[2, -2], [2, 2]], "speed": 1.0, "floor": -1.0}
    scene = Scene.of({"objects": [FAR], "moving": [walker], "interferers": [{"name": "a"} | other]}, "place")
    made = Scenario(scene, Motion.still((0, 0, 0)), CONFIG, IDEAL)
    assert made.interference(made.motion, 0.0).any()
    assert not made.interference(made.motion, 2.0 - CONFIG.burst_center).any()


# --- recordings ------------------------------------------------------------------------------------------------------
ROOM = {
    "objects": [
        {"name": "wall", "shape": "rectangle", "size": [4, 3], "position": [3, 0, 1], "facing": [-1, 0, 0],
         "material": "concrete"},
        {"name": "floor", "shape": "rectangle", "size": [6, 4], "position": [1, 0, 0], "facing": [0, 0, 1],
         "material": "concrete"},
    ]
}  # fmt: skip
ROBOT = {
    "name": "robot", "position": [2.5, 1, 1], "yaw": 200, "velocity": [-0.5, 0, 0],
    "radar": {"slope": 60e12, "idle_time": 83e-6, "ramp_end_time": 55e-6, "loops": 40, "frame_period": 31e-3},
}  # fmt: skip


def walk(*others: dict) -> Scenario:
    scene = Scene.of(ROOM | {"interferers": list(others)}, "room")
    return Scenario(scene, Motion.linear((0, 0, 1), (0.5, 0.1, 0)), CONFIG, FrontEndConfig.of(CONFIG.board), seed=3)


def test_frames_are_functions_of_their_instants():
    made = walk(ROBOT)
    whole = made.frames(made.times[:6]).samples
    parts = [made.frames(made.times[k : k + 1]).samples[0] for k in reversed(range(6))][::-1]
    assert np.array_equal(whole, parts)
    assert not np.array_equal(whole[:3], walk().frames(made.times[:3]).samples)


def test_who_sends_elsewhere_changes_nothing():
    """An interferer in another band, or one that has not started, does not change the samples."""
    plain = walk()
    expected = plain.frames(plain.times[:2]).samples
    for other in ({"radar": {"start_frequency": 60e9, "board": "iwr6843isk"}}, {"start": 0.5}):
        assert np.array_equal(walk(ROBOT | other).frames(plain.times[:2]).samples, expected)
    assert not np.array_equal(walk(ROBOT | {"start": 0.03}).frames(plain.times[:2]).samples[1], expected[1])


def test_the_pipeline_leaves_such_chirps_out(tmp_path):
    """A recording lists the interferers, and the chirps that the pipeline leaves out are those that were disturbed."""
    scene = Scene.of(ROOM | {"interferers": [ROBOT]}, "room")
    config = PRESETS["radarize"]
    places = np.array([[0.0, 0.0], [0.8, 0.1]])
    path = simulate(scene, tmp_path / "x.h5", duration=0.4, waypoints=places, seed=2, sensors=["adc-by-cause"])
    with Recording(path) as recording:
        samples, valid = recording.adc(0, len(recording)), recording.valid(0, len(recording))
        (stated,) = json.loads(recording.attributes["interferers"])
        parts = recording.read("truth/adc_by_cause")
        about = recording.describe("truth/adc_by_cause")["about"]
    assert (stated["name"], stated["velocity"], stated["radar"]["slope"]) == ("robot", [-0.5, 0.0, 0.0], 60e12)
    assert about.endswith("interference, leakage")
    found = find_flaws(samples, valid).disturbed
    window = np.hanning(config.samples)[:, None]  # what falls into its ends harms nobody, and is not looked for
    power = np.mean((parts[:, -2].astype(float) * window) ** 2, axis=(-3, -2, -1))  # counts^2, (frame, loop, tx)
    assert found.shape == power.shape == (len(samples), config.loops, 3)
    assert 0.02 < found.mean() < 0.3
    assert found[power > 300].all() and not found[power < 10].any()
    assert (power > 300).mean() > 0.8 * found.mean()


# --- mistakes --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"radar": "car"}, r"\[0\]\.radar \(object 'robot'\) is 'car': expected one of the presets radarize"),
        ({"radar": {"slop": 1}}, r"\[0\]\.radar\.slop \(object 'robot'\): unknown key"),
        ({"radar": {"slope": -1}}, r"\[0\]\.radar\.slope \(object 'robot'\) is -1: "),
        ({"radar": {"loops": 4000}}, r"\[0\]\.radar \(object 'robot'\): frame_period is 33\.333 ms, expected"),
        ({"radar": 3}, r"\[0\]\.radar \(object 'robot'\) is 3: "),
        ({"position": [1, 2]}, r"interferers\[0\]\.position"),
        ({"clock_ppm": 5000}, r"clock_ppm .*5000"),
        ({"speed": 3}, r"interferers\[0\]\.speed \(object 'robot'\): unknown key"),
    ],
)
def test_mistakes_are_named(changes, words):
    with pytest.raises(InputError, match=words) as caught:
        walk(ROBOT | changes)
    assert "\n" not in str(caught.value)


def test_levels_change_and_add_them(tmp_path):
    path = tmp_path / "place.yaml"
    path.write_text(
        "objects: [{name: wall, shape: box, size: [1, 1, 1], material: wood}]\n"
        "interferers: [{name: one, radar: {slope: 70e12, idle_time: 9e-5}, position: [4, 0, 1], yaw: 180}]\n"
        "levels: [{interferers: [{name: one, yaw: 90}, {name: two, radar: long-range, position: [5, 1, 1]}]}]\n"
    )
    (mild,), (one, two) = Scene.load(path).interferers, Scene.load(f"{path}@1").interferers
    assert (mild.yaw, one.yaw, one.radar) == (180, 90, mild.radar) and mild.radar.slope == 70e12
    assert two.radar == PRESETS["long-range"]
