"""Scatterers, small things and unevenness of surfaces."""

import numpy as np
from scipy import stats
from scipy.special import gamma

from benchmarks.gallery.drawing import AHEAD, CONFIG, FOUND, HERE, LAMBDA, THEORY, compare
from benchmarks.references.front_end import db
from benchmarks.references.reciprocity import there_and_back
from benchmarks.references.rigs import Rig, burst, field
from benchmarks.references.speckle import speckle as speckles
from radarsim.propagation.clutter import CROSS_SECTION, EXPONENT, ON_WALLS, STRUCTURE, Clutter, in_the_open
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.propagation.surface import Surface
from radarsim.propagation.unevenness import SCALES, Heights
from radarsim.world import shapes
from radarsim.world.materials import material
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene
from radarsim.world.surface_settings import SurfaceSettings


def clutter(rng: np.random.Generator, count: int) -> Scatterers:
    """A patch of wall 3 m ahead, as scatterers of random phase with one cross section in all."""
    place = np.stack([np.full(count, 3.0), rng.uniform(-3, 3, count), rng.uniform(-1, 1, count)], axis=1)
    return Scatterers.points(place, np.full(count, 12.0 / count), rng.uniform(0, 2 * np.pi, count))


def speckle(axis) -> str:
    """Where many scatterers share a range cell, amplitudes have a Rayleigh distribution."""
    amplitude, x = speckles(150), np.linspace(0, 4, 200)
    axis.plot(x, stats.rayleigh.cdf(x), **THEORY)
    axis.plot(np.sort(amplitude), (np.arange(150) + 0.5) / 150, **FOUND | {"ms": 2})
    return f"Kolmogorov-Smirnov test over 150 positions: p = {stats.kstest(amplitude, stats.rayleigh.cdf).pvalue:.2f}."


def decorrelation(axis) -> str:
    """Speckle belongs to the world. A radar that has moved should find the field of the same scatterers from its new
    place."""
    shifts = np.geomspace(1e-4, 0.1, 16)
    own, frozen, kept = [], [], []
    finders = [PathFinder(None, clutter(np.random.default_rng(k), 3000), None, CONFIG, range=9.0) for k in range(40)]
    first = [f(HERE, AHEAD) for f in finders]
    start = np.array([field(e, HERE, LAMBDA) for e in first])
    for shift in shifts:
        moved = np.array([0.0, shift, 0.0])
        anew = np.array([field(f(moved, AHEAD), moved, LAMBDA) for f in finders])
        same = np.array([field(e, moved, LAMBDA) for e in first])
        for values, pair in ((own, (start, anew)), (frozen, (start, same)), (kept, (same, anew))):
            values.append(abs(np.vdot(*pair)) / np.linalg.norm(pair[0]) / np.linalg.norm(pair[1]))
    axis.semilogx(1e3 * shifts, frozen, **THEORY | {"label": "frozen scatterers"})
    axis.semilogx(1e3 * shifts, own, **FOUND | {"label": "found anew"})
    near = np.array(kept)[shifts <= 0.0101]
    return (
        f"The correlation of both fields is at least {near.min():.5f} up to 10 mm, and {np.min(kept):.5f} up to 10 "
        "cm. The rest comes from the antenna pattern, which changes the amplitudes."
    )


def convergence(axis) -> str:
    """Surfaces are sampled by scatterers. More scatterers should give the same mean power in a range cell."""
    counts, draws, levels = [250, 500, 1000, 2000, 4000, 8000], 300, []
    once = CONFIG.model_copy(update={"loops": 1, "tx_order": (0,)})
    for count in counts:
        power = []
        for seed in range(draws):
            finder = PathFinder(None, clutter(np.random.default_rng((count, seed)), count), None, once, range=9.0)
            spectrum = np.fft.fft(burst(once, finder(HERE, AHEAD), Rig()), axis=-1)
            power.append(np.mean(np.abs(spectrum[..., 67:85]) ** 2))  # 3 to 3.8 m
        levels.append(db(np.mean(power)))
    axis.axhline(0, **THEORY)
    axis.semilogx(counts, np.array(levels) - np.mean(levels), base=2, **FOUND)
    axis.set(ylim=(-0.5, 0.5))
    return f"Twice as many scatterers change it by at most {np.abs(np.diff(levels)).max():.2f} dB ({draws} draws each)."


def small_things(axis) -> str:
    """What is smaller than 2 cm is a Poisson process on every surface; larger things are drawn. Cross sections follow
    Weibull's distribution, P(> s) = exp(-(s / s0)^0.7), and take from the wall what they scatter."""
    wall = SceneObject("wall", shapes.rectangle((3, 0, 1.5), (40, 3), (-1, 0, 0)), material("wood"))
    things = Clutter(Scene("wall", [wall], surface_settings=SurfaceSettings(clutter=1)), np.random.default_rng(0))
    sigma = np.sort(things.near(np.zeros((1, 3)), 50.0).sigma)
    mean = CROSS_SECTION * in_the_open(np.array([STRUCTURE + ON_WALLS * CROSS_SECTION / 4]))[0]
    weibull = stats.weibull_min(EXPONENT, scale=mean / gamma(1 + 1 / EXPONENT))
    dbsm, share = db(sigma), (np.arange(len(sigma)) + 0.5) / len(sigma)
    axis.plot(dbsm, weibull.cdf(sigma), **THEORY)
    axis.plot(dbsm[::20], share[::20], **FOUND)
    return (
        f"Points per square metre of wall: {len(sigma) / 120:.2f}, set to {ON_WALLS:g}. Their mean: "
        f"{db(sigma.mean()):.1f} dBsm head-on, set to {db(mean):.1f}. Kolmogorov-Smirnov test: p = "
        f"{stats.kstest(sigma, weibull.cdf).pvalue:.2f}. The densities were chosen by comparison with RadarHD's "
        "training walks, never with its test walks (`benchmarks.realism`)."
    )


def uneven_walls(axis) -> str:
    """Along an uneven wall, the specular reflection is correlated as the phases of the wall's points are:
    exp(-(2k)^2 (<z z> - <z z'>))."""
    wall = SceneObject("wall", shapes.rectangle((0, 0, 0), (6, 6), (1, 0, 0)), material("plasterboard"))
    steps, level, walls = np.append(np.geomspace(2e-3, 0.3, 16), 10.0), 0.25, 300
    place = np.stack([np.full_like(steps, 2.0), steps, np.zeros_like(steps)], axis=1)
    place = np.concatenate([[[2.0, 0.0, 0.0]], place])
    scene, factors = Scene("wall", [wall], surface_settings=SurfaceSettings(unevenness=level)), []
    for seed in range(walls):
        heights = Heights.of(scene, np.random.default_rng(seed))
        factors.append(heights.factors(place, place * [0, 1, 1], np.ones(len(place)), LAMBDA))
    factors = np.array(factors)
    found = np.abs(np.mean(factors[:, 1:] * factors[:, :1].conj(), axis=0))
    lost = sum((level * rms) ** 2 * (1 - np.exp(-((steps / length) ** 2))) for rms, length in SCALES)
    theory = np.exp(-((4 * np.pi / LAMBDA) ** 2) * lost)
    axis.set_xscale("log")
    worst = compare(axis, 1e3 * steps[:-1], theory[:-1], found[:-1])
    return (
        f"The correlation has an error of {worst:.3f} at most, over {walls} walls of a quarter of the usual "
        "unevenness, 2 m away. The mean power of the specular reflection is "
        f"{np.mean(np.abs(factors) ** 2):.2f} of a flat wall's: unevenness makes it fade now and then, but not fainter "
        "on average."
    )


def reciprocity(axis) -> str:
    """The field stays the same when transmitter and receiver swap places. Tested for each number of bounces in
    the office."""
    scene = Scene.load("office")
    surface = Surface(scene, np.random.default_rng(1), density=60.0)
    position = np.array([8.0, 6.0, 1.2])
    echoes = PathFinder(scene, surface, Reflectors.of(scene, CONFIG), CONFIG, 1e-7)(position, AHEAD)
    (there, back), names, levels = there_and_back(echoes, position), [], []
    for bounces in np.unique(echoes.bounces):
        some = echoes.bounces == bounces
        names.append(f"{bounces} bounces ({some.sum()})")
        levels.append(2 * db(abs((there - back)[some].sum()) / abs(there[some].sum()) + 1e-15))
    axis.barh(names, levels, color="tab:red")
    axis.axvline(-60, color="black", lw=1)
    axis.set(xlim=(min(levels) * 1.1, 0))
    axis.figure.subplots_adjust(left=0.3)
    return f"The difference of both fields is {max(levels):.0f} dB at most, relative to the field."
