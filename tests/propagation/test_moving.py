"""Moving objects: their scatterers, occlusion by them, and their echoes chirp by chirp."""

import numpy as np
import pytest

from benchmarks.references.rigs import ELEMENT, Rig, polar
from radarize.radar.array import rx_positions, tx_positions
from radarize.radar.config import SPEED_OF_LIGHT
from radarize.radar.presets import PRESETS
from radarsim.propagation.antenna import amplitude_gain
from radarsim.propagation.burst import BurstClock
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.movingtargets import MovingTargets
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.receiver.synthesis import Synthesizer
from radarsim.world.materials import MATERIALS
from radarsim.world.movers import Door, Fan, Person
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene
from radarsim.world.shapes import rectangle

CONFIG = PRESETS["radarize"]
NOTHING = Scatterers.points(np.zeros((0, 3)), np.zeros(0))
WALKER = Person(name="walker", path=((0, 0), (10, 0)), speed=1.2)


def test_scatterers_are_carried_along():
    """A scatterer keeps its distance from all others of the same part."""
    crowd = MovingTargets([WALKER, Fan(name="f", center=(3, 1, 2))], np.random.default_rng(1))
    places = crowd.positions(np.array([0.3, 1.7]))
    for part in (0, 3, 10):
        own = places[:, crowd.part == part]
        gaps = np.linalg.norm(own[:, :, None] - own[:, None], axis=3)
        assert gaps[0] == pytest.approx(gaps[1], abs=1e-9)
    assert crowd.sigma[crowd.part < 10].sum() == pytest.approx(4 * WALKER.cross_section)


def test_occlusion_against_brute_force():
    """Segments at three times against capsules and boxes: the same as sampling a thousand points along each."""
    rng = np.random.default_rng(2)
    movers = [WALKER, Door(name="d", hinge=(2, 0.5, 1)), Fan(name="f", center=(1, -0.5, 1.5))]
    crowd = MovingTargets(movers, rng)
    origins, targets = rng.uniform([-1, -1.5, 0], [4, 1.5, 2], (2, 1500, 3))
    times, which = np.array([0.2, 0.9, 1.6]), rng.integers(0, 3, 1500)
    hidden = crowd.occluded(origins, targets, t=times[which], margin=0.0)
    turn, center = crowd.poses(times)
    along = origins[:, None] + np.linspace(0, 1, 1001)[:, None] * (targets - origins)[:, None]
    truth, border = np.zeros(1500, bool), np.zeros(1500, bool)
    for k, part in enumerate(part for mover in movers for part in mover.parts()):
        local = (along - center[which, k][:, None]) @ turn[which, k]
        if part.capsule:
            axis = local - np.clip(local[..., 2], -part.half[2], part.half[2])[..., None] * [0, 0, 1]
            depth = part.half[0] - np.linalg.norm(axis, axis=2)
        else:
            depth = (np.asarray(part.half) - np.abs(local)).min(axis=2)
        truth |= (depth > 0).any(axis=1)
        border |= np.abs(depth.max(axis=1)) < 3e-3
    assert 0.1 < truth.mean() < 0.9
    assert np.array_equal(hidden[~border], truth[~border])


def alone(movers, scene=None, surface=NOTHING, seed=0):
    """A finder with moving targets only, and these targets."""
    crowd = MovingTargets(movers, np.random.default_rng(seed), density=60.0)
    facets = None if scene is None else Reflectors.of(scene, CONFIG)
    return PathFinder(scene, surface, facets, CONFIG, moving=crowd), crowd


def brute_force(echoes, crowd, time, which, mirror=None):
    """Beat signal with every scatterer at its exact position for every sample of every chirp; `which`: scatterer of
    each echo."""
    loops, n_tx, n_rx, samples, _ = CONFIG.frame_shape
    on_ramp = (np.arange(samples) - (samples - 1) / 2) / CONFIG.sample_rate
    tx, rx = tx_positions(CONFIG), rx_positions(CONFIG)
    out = np.zeros((loops, n_tx, n_rx, samples), complex)
    for loop in range(0, loops, 5):
        for k in range(n_tx):
            ends = crowd.positions(time + CONFIG.chirp_times[loop, k] + on_ramp[[0, -1]])[:, which]
            share = np.linspace(0, 1, samples)[:, None, None]  # straight within the 42 us of a ramp
            place = (1 - share) * ends[0] + share * ends[1]
            for r in range(n_rx):
                segments = []
                for way, antenna in enumerate((tx[k], rx[r])):
                    image = place * [1, -1, 1] + [0, 4, 0]
                    virtual = place if mirror is None else np.where(mirror[:, way, None], image, place)
                    segments.append(np.linalg.norm(virtual - antenna, axis=2))
                delay = (segments[0] + segments[1]) / SPEED_OF_LIGHT
                phase = CONFIG.center_frequency * delay + CONFIG.slope * delay * (on_ramp[:, None] - delay / 2)
                out[loop, k, r] = (echoes.amplitude * np.exp(2j * np.pi * phase)).sum(axis=1)
    return out


def error_db(found, truth):
    used = np.abs(truth).sum(axis=(1, 2, 3)) > 0
    return 10 * np.log10(np.sum(np.abs(found - truth)[used] ** 2) / np.sum(np.abs(truth) ** 2))


@pytest.mark.parametrize(
    ("mover", "below"),
    [
        # A parabola a burst is not exact where things jerk: shins do by 300 m/s^3.
        (Person(name="walker", path=((1.5, 0.5), (3.5, -0.5)), speed=1.4), -35),
        (Fan(name="fan", center=(2, 0, 0), axis=(0, 0.3, 1), radius=0.5, turns_per_second=1.0), -35),
        (Door(name="door", hinge=(2, -0.4, 0), width=0.9, period=3.0), -40),
    ],
    ids=["person", "fan", "door"],
)
def test_phases_against_brute_force(mover, below):
    finder, crowd = alone([mover])
    time = 0.7
    echoes = finder(np.zeros(3), np.eye(3), time + CONFIG.burst_center)
    assert len(echoes) > 5 and echoes.moving.all()
    found = Synthesizer(CONFIG)(echoes.lengths(CONFIG, Rig(), time), echoes.amplitude)
    middle = crowd.positions(np.array([time + CONFIG.burst_center]))[0]
    gap = np.linalg.norm(middle - echoes.points[:, :1], axis=2)
    assert gap.min(axis=1).max() < 1e-9
    assert error_db(found, brute_force(echoes, crowd, time, gap.argmin(axis=1))) < below


def test_ghosts_of_movers_move_as_mirrored():
    """Over a metal wall 2 m to the left: the reflected path segment follows the mirrored walker."""
    wall = Scene("wall", [SceneObject("wall", rectangle((2, 2, 0), (8, 4), (0, -1, 0)), MATERIALS["metal"])])
    finder, crowd = alone([Person(name="p", path=((2, -0.5), (2, 1.0)), speed=1.3, floor=-1.0)], wall)
    time = 0.5
    echoes = finder(np.zeros(3), np.eye(3), time + CONFIG.burst_center).where(moving=True)
    middle = crowd.positions(np.array([time + CONFIG.burst_center]))[0]
    mirrored = echoes.points[:, :, 1] > 2
    assert mirrored.any(axis=1).sum() >= 6 and mirrored.all(axis=1).any()
    straight = np.where(mirrored[..., None], echoes.points * [1, -1, 1] + [0, 4, 0], echoes.points)
    which = np.linalg.norm(middle - straight[:, :1], axis=2).argmin(axis=1)
    found = Synthesizer(CONFIG)(echoes.lengths(CONFIG, Rig(), time), echoes.amplitude)
    assert error_db(found, brute_force(echoes, crowd, time, which, mirrored)) < -35


def test_an_approaching_person_closes():
    """A person who walks towards the radar has a positive closing speed, about the walking speed."""
    mover = Person(name="p", path=((4.0, 0), (0.5, 0)), speed=1.0, floor=-1.0)
    finder, _ = alone([mover])
    echoes = finder(np.zeros(3), np.eye(3), 1.0)
    lengths = echoes.lengths(CONFIG, Rig(), 1.0 - CONFIG.burst_center)
    closing = -lengths[:, 0, 1] / BurstClock.of(CONFIG).half / 2
    assert np.median(closing) == pytest.approx(1.0, abs=0.15)
    assert np.ptp(closing) > 0.5  # swinging limbs


def test_a_person_casts_a_shadow():
    """Points behind a standing person have no echo; those beside do."""
    person = Person(name="p", path=((1.5, 0),), floor=-1.0)
    place = np.array([polar(3.0, azimuth) for azimuth in (-20, 0, 20)])
    finder, _ = alone([person], surface=Scatterers.points(place, np.ones(3)))
    echoes = finder(np.zeros(3), np.eye(3), 0.0).where(bounces=0, through=False, moving=False)
    seen = {round(float(np.rad2deg(np.arctan2(p[1], p[0])))) for p in echoes.points[:, 0]}
    assert seen == {-20, 20}


def test_cross_section_of_a_person():
    """The echoes of a person add up to about the specified cross section."""
    person = Person(name="p", path=((3.0, 0),), floor=-1.0, cross_section=0.5)
    finder, _ = alone([person])
    echoes = finder(np.zeros(3), np.eye(3), 0.0)
    gain = np.array([amplitude_gain(*point, ELEMENT) for point in echoes.points[:, 0]])
    scale = CONFIG.wavelength / (4 * np.pi) ** 1.5 * gain**2 / np.sum(echoes.points[:, 0] ** 2, axis=1)
    found = np.sum((np.abs(echoes.amplitude) / scale) ** 2)
    assert 10 * np.log10(found / 0.5) == pytest.approx(0, abs=1.5)  # limbs hide one another
