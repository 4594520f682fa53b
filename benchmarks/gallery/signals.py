"""Motion, noise and other radars in the samples."""

import numpy as np

from benchmarks.gallery.drawing import AHEAD, CONFIG, HERE, compare, target
from benchmarks.references.bursts import slot_phases, tone_ranges
from benchmarks.references.front_end import db, law, noise_factor, skirt
from benchmarks.references.interferers import CASES, brute_force, scenario
from benchmarks.references.rigs import Rig, burst
from benchmarks.references.signature import ridge
from radarsim.receiver.frontend import BOLTZMANN, ROOM_TEMPERATURE, FrontEnd
from radarsim.receiver.frontend_config import FrontEndConfig


def doppler(axis) -> str:
    """Where nothing moves but the radar, an echo at azimuth theta comes nearer at v cos(phi - theta), where v and phi
    are the radar's speed and course. In a Doppler-azimuth map this is a curve."""
    maps, power, found = ridge(Rig(velocity=(0.85, 0.85, 0)))
    axis.pcolormesh(np.rad2deg(maps.azimuths), maps.velocities, db(power), vmin=db(power.max()) - 25, rasterized=True)
    theory = 0.85 * np.cos(maps.azimuths) + 0.85 * np.sin(maps.azimuths)
    axis.plot(np.rad2deg(maps.azimuths), theory, color="white", lw=1, label="0.85 cos + 0.85 sin")
    error = (found - theory)[np.abs(maps.azimuths) < 0.87]
    return (
        f"The ridge is off the curve by {abs(np.median(error)):.4f} m/s, in the median of all azimuths within 50 deg."
    )


def tdm(axis) -> str:
    """The three transmitters take turns: TX3 sends one slot after TX1, TX2 two. From slot to slot, an echo that comes
    nearer turns its phase by -4 pi v Tc / lambda."""
    speeds = np.linspace(-1.8, 1.8, 13)
    found, theory = map(np.array, zip(*map(slot_phases, speeds), strict=True))
    for k, name in ((2, "TX3"), (1, "TX2")):
        axis.plot(speeds, np.rad2deg(theory[:, k]), color="black", lw=1)
        axis.plot(speeds, np.rad2deg(np.unwrap(found[:, k])), ls="", marker="o", ms=3.5, label=name)
    error = np.rad2deg(np.abs(np.angle(np.exp(1j * (found - theory)))).max())
    return (
        f"Phases have an error of {error:.2f} deg at most. Speeds up to {CONFIG.max_velocity:.3f} m/s are unambiguous."
    )


def range_walk(axis) -> str:
    """An echo moves through range bins during one burst, chirp by chirp."""
    speed = 1.6
    found = tone_ranges(burst(CONFIG, target(3.0, 0, 0)(HERE, AHEAD), Rig(velocity=(speed, 0, 0))), 3.0)
    # the Doppler shift within the ramp makes range read f_c v / S too short
    theory = 3 - speed * CONFIG.chirp_times[:, 0] - CONFIG.center_frequency * speed / CONFIG.slope
    worst = compare(axis, np.arange(len(found)), theory, found)
    walk = 1e3 * (found[0] - found[-1])
    return (
        f"At 1.6 m/s the echo moves by {walk:.2f} mm; a bin is {1e3 * CONFIG.range_resolution:.1f} mm. The worst "
        f"chirp has an error of {1e3 * worst:.3f} mm. Theory includes range-Doppler coupling."
    )


def noise(axis) -> str:
    """The noise power is k T B F. The noise figure F depends on the receive gain: Friis's formula through 15.6 dB at a
    gain of 30 dB, and 15 dB at 48 dB."""
    gains, found = np.arange(24.0, 50, 4), []
    silence = np.zeros(CONFIG.frame_shape[:-1], np.complex64)
    for gain in gains:
        front = FrontEnd(CONFIG.model_copy(update={"rx_gain_db": gain}), FrontEndConfig.ideal(noise=True))
        counts = front.receive(silence, np.random.default_rng(0))
        watts = np.mean(np.abs(counts) ** 2) / front.counts**2
        found.append(watts / (BOLTZMANN * ROOM_TEMPERATURE * CONFIG.sample_rate))
    worst = compare(axis, gains, db(noise_factor(gains)), db(np.array(found)))
    return f"Error: {worst:.3f} dB at the worst of {len(gains)} gains."


def phase_noise(axis) -> str:
    """Phase noise surrounds each echo with a skirt of 4 L(f) sin^2(pi f tau). The transmitter's noise is mixed with
    itself, so the skirt vanishes with the delay tau."""
    bins, step, worst = np.arange(CONFIG.samples), CONFIG.sample_rate / CONFIG.samples, 0.0
    for cell, color in ((10, "tab:blue"), (40, "tab:orange"), (90, "tab:green")):
        off = np.where(bins == cell, np.nan, bins - cell)  # the echo itself is none of its skirt
        theory, found, far = law(cell, off) / step, skirt(cell) / step + 0 * off, np.abs(bins - cell) > 4
        axis.plot(bins, db(theory), color="black", lw=1)
        label = f"echo at {CONFIG.ranges[cell]:.2f} m"
        axis.plot(bins, db(found), ".", ms=4, color=color, label=label)
        worst = max(worst, abs(db(found[far].mean() / theory[far].mean())))
    axis.set(ylim=(-150, -98))
    return f"The mean level of a skirt has an error of {worst:.2f} dB at most."


def interference(axis) -> str:
    """The chirp of another radar is within the IF band for the band's width over the difference of the slopes. Its
    power is P G G' (lambda / 4 pi d)^2, by Friis (Brooker, IEEE Trans. EMC 49, 2007)."""
    other, _ = CASES["steep"]
    made = scenario(other)
    found = made.interference(made.motion, 0.0)[0, 0, 2]
    product = brute_force(made, 0.0, 0, 0, 2)
    at = 1e6 * (CONFIG.adc_start_time + np.arange(CONFIG.samples) / CONFIG.sample_rate)
    compare(axis, at, db(np.abs(product) ** 2), db(np.abs(found) ** 2))
    worst = np.abs(found - product).max() / np.abs(product).max()
    return (
        "Theory multiplies both waveforms in steps of 0.1 ns and filters the product; the simulator uses Fresnel "
        "integrals. The other radar is 4 m away, its slope 2 MHz/us less. The worst sample has an error of "
        f"{100 * worst:.3f} % of the peak. Only the straight path counts, and what stands in its way."
    )
