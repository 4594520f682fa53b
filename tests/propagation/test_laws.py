"""Laws of radar physics against their closed forms."""

import numpy as np
import pytest

from benchmarks.references.bursts import CONFIG, point_echoes, slot_phases, tone_ranges
from benchmarks.references.rigs import ELEMENT, Rig, burst, locate, polar
from radarize.radar.array import virtual_positions
from radarize.radar.config import SPEED_OF_LIGHT
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.scatterers import Scatterers
from radarsim.receiver.frontend import FrontEnd
from radarsim.receiver.frontend_config import Band, FrontEndConfig


@pytest.mark.parametrize(
    ("range_", "azimuth", "elevation"), [(2.0, 0, 0), (3.7, 25, 0), (2.2, -35, 8), (4.0, 10, -12), (2.5, -50, 15)]
)
def test_point_target_obeys_the_radar_equation(range_, azimuth, elevation):
    center = virtual_positions(CONFIG).mean(axis=(0, 1)) / 2  # from here the array sees directions
    place = center + polar(range_, azimuth, elevation)
    signal = burst(CONFIG, point_echoes(place, sigma=0.5), Rig())
    guess = (range_ + 0.01, np.deg2rad(azimuth + 1), np.deg2rad(elevation - 1), 0.02)
    found_range, found_azimuth, found_elevation, speed, amplitude = locate(CONFIG, signal, guess)
    az, el, _ = ELEMENT
    degrees = np.linspace(0, 90, 181)
    gain = np.interp(abs(azimuth), degrees, az) ** 2 * np.interp(abs(elevation), degrees, el) ** 2
    expected = gain**2 * CONFIG.wavelength**2 * 0.5 / ((4 * np.pi) ** 3 * range_**4)
    assert abs(10 * np.log10(abs(amplitude) ** 2 / expected)) < 0.2
    assert abs(found_range - np.linalg.norm(place)) < 1e-3
    assert abs(np.rad2deg(found_azimuth) - azimuth) < 0.1
    assert abs(np.rad2deg(found_elevation) - elevation) < 0.1
    assert abs(speed) < 0.005


@pytest.mark.parametrize("velocity", [(0.5, 0, 0), (-1.2, 0, 0), (0, 0.8, 0), (0, -0.8, 0), (0.7, 0.7, 0.1)])
@pytest.mark.parametrize("azimuth", [-30, 0, 30])
def test_doppler_of_sensor_motion(velocity, azimuth):
    """A static point is approached at v . u: closing speed is positive."""
    rig = Rig(velocity=velocity)
    place = polar(3.0, azimuth) + CONFIG.burst_center * np.array(velocity)
    truth = np.dot(velocity, polar(1.0, azimuth))
    signal = burst(CONFIG, point_echoes(place), rig)
    *_, speed, _ = locate(CONFIG, signal, (3.0, np.deg2rad(azimuth), 0.0, truth + 0.02))
    assert abs(speed - truth) < 0.005


@pytest.mark.parametrize("rate", [-1.5, 1.5])
def test_doppler_of_a_lever_arm(rate):
    """Rotation about a point 0.4 m behind the sensor moves it sideways at omega x r, left for a left turn."""
    rig = Rig(yaw_rate=rate, yaw=-rate * CONFIG.burst_center, lever=(0.4, 0, 0))
    place = np.array([0.4, 0, 0]) + polar(3.0, 40)
    finder = PathFinder(None, Scatterers.points(place, np.ones(1)), None, CONFIG)
    signal = burst(CONFIG, finder(np.array([0.4, 0, 0]), np.eye(3)), rig)
    truth = 0.4 * rate * np.sin(np.deg2rad(40))
    *_, speed, _ = locate(CONFIG, signal, (3.0, np.deg2rad(40), 0.0, truth))
    assert abs(speed - truth) < 0.005
    assert np.sign(truth) == np.sign(rate)


def test_doppler_frequency_in_hertz():
    """2 f_c / c per m/s: 513.69 Hz at 77 GHz, scaled to the centre of the sweep."""
    speed = 1.0
    signal = burst(CONFIG, point_echoes(polar(3.0)), Rig(velocity=(speed, 0, 0)))
    loops = np.unwrap(np.angle(signal[:, 0, 0, CONFIG.samples // 2]))
    frequency = np.polyfit(CONFIG.loop_time * np.arange(CONFIG.loops), loops, 1)[0] / (2 * np.pi)
    assert frequency == pytest.approx(-513.69 * CONFIG.center_frequency / 77e9 * speed, rel=2e-3)


@pytest.mark.parametrize("speed", [-1.6, 0.8])
def test_tdm_slot_phase(speed):
    """TX3 fires one slot and TX2 two slots after TX1."""
    advance, law = slot_phases(speed)
    assert advance == pytest.approx(np.angle(np.exp(1j * law)), abs=0.02)


def test_range_walk_within_a_burst():
    """At 1.6 m/s an echo walks 2.6 cm through the burst, more than half a range bin."""
    speed = 1.6
    signal = burst(CONFIG, point_echoes(polar(3.0)), Rig(velocity=(speed, 0, 0)))
    ranges = tone_ranges(signal, 3.0)
    walked = ranges[-1] - ranges[0]
    expected = -speed * CONFIG.loop_time * (CONFIG.loops - 1)
    assert walked == pytest.approx(expected, abs=2e-4)


def test_range_doppler_coupling():
    """Motion during the ramp shifts the beat by the Doppler frequency: range reads f_c v / S too short."""
    speed = 1.5
    place = polar(3.0) + CONFIG.burst_center * np.array([speed, 0, 0])
    signal = burst(CONFIG, point_echoes(place), Rig(velocity=(speed, 0, 0)))
    shift = tone_ranges(signal, 3.0).mean() - 3.0
    tx1_lead = speed * CONFIG.chirp_time  # TX1 fires one slot before the burst's mean instant
    assert shift - tx1_lead == pytest.approx(-CONFIG.center_frequency * speed / CONFIG.slope, rel=0.03)


def test_noise_floor_is_ktbf():
    """Noise only: k T B F at the input, times gain, in counts; white over the flat part of the band."""
    front = FrontEnd(CONFIG, FrontEndConfig.ideal(noise=True, band=Band()))
    silence = np.zeros((CONFIG.loops, 3, 4, CONFIG.samples), np.complex64)
    iq = front.digitize(silence, np.random.default_rng(3)).astype(float)
    spectrum = np.abs(np.fft.fft(iq[..., 0] + 1j * iq[..., 1], axis=-1)) ** 2 / CONFIG.samples
    floor = spectrum[..., 4:80].mean()
    watts = 1.380649e-23 * 290 * 2.285e6 * 10 ** (15.6 / 10) * 10 ** (30 / 10)
    counts = watts / 1e-3 / 10 ** (5 / 10) * 32767**2
    rounding = 2 / 12  # variance of rounding I and Q to one count
    assert 10 * np.log10(floor / (counts + rounding)) == pytest.approx(0, abs=0.1)
    drop = 10 * np.log10(floor / spectrum[..., 91:].mean())
    assert 2 < drop < 9  # as the last sixteenth of real captures


def test_noise_is_seeded():
    front = FrontEnd(CONFIG)
    silence = np.zeros((CONFIG.loops, 3, 4, CONFIG.samples), np.complex64)
    first, again, other = (front.digitize(silence, np.random.default_rng(s)) for s in (1, 1, 2))
    assert np.array_equal(first, again) and not np.array_equal(first, other)


def test_saturation_clips_and_never_wraps():
    front = FrontEnd(CONFIG, FrontEndConfig.ideal())
    loud = np.full((CONFIG.loops, 3, 4, CONFIG.samples), 1.0 - 1.0j, np.complex64)
    iq = front.digitize(loud, np.random.default_rng(0))
    assert (iq[..., 0] == 32767).all() and (iq[..., 1] == -32768).all()


def test_high_pass_removes_near_echoes():
    """Two first-order stages at 175 and 350 kHz: 3 dB and 7 dB down where the beat is 175 kHz."""
    front = FrontEnd(CONFIG)
    length = SPEED_OF_LIGHT * 175e3 / CONFIG.slope
    expected = np.sqrt(1 / 2) * 1 / np.sqrt(1 + 4)
    assert abs(front.if_response(np.array([length])))[0] == pytest.approx(expected, rel=1e-6)
    beyond = np.array([2 * CONFIG.max_range * 1.15])
    assert abs(front.if_response(beyond))[0] == 0
