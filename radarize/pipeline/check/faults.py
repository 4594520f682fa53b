"""Faults that a check looks for, in the order of the tests: first those that hide all others.

A test is a function from `Evidence` to findings; it raises `NotObservable` if the recording does not show whether the
fault is there. To add one, write a function and add it to `TESTS`.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

from radarize.pipeline.check import array, disturbance, encoding, levels, orientation, sequence, stamps
from radarize.pipeline.check.evidence import Evidence
from radarize.pipeline.check.finding import Finding


class Test(NamedTuple):
    """A test of a check.

    Attributes:
        find: the test function.
        kinds: kinds of faults that it finds.
        unless: kinds of faults after which the test is skipped.
        whole: it examines all frames instead of some.
    """

    find: Callable[[Evidence], Iterator[Finding]]
    kinds: tuple[str, ...]
    unless: tuple[str, ...] = ()
    whole: bool = False


STILL = ("no motion",)
TESTS = (
    Test(levels.silence, ("no signal",)),
    Test(levels.one_of_two, ("I without Q",)),
    Test(levels.offset_binary, ("offset-binary samples",)),
    Test(encoding.order_of_words, ("byte order", "layout", "layout of I and Q", "loops and chirps")),
    Test(levels.noise, ("pure noise",)),
    Test(levels.image, ("I without Q",)),
    Test(encoding.i_and_q, ("I and Q",)),
    Test(levels.scaled, ("samples scaled",)),
    Test(
        levels.receivers,
        ("receiver dead", "receiver saturated", "channels identical", "receiver copied", "transmitter copied"),
    ),
    Test(levels.transmitters, ("transmitter dead",)),
    Test(stamps.bursts, ("stamps too dense",)),
    Test(stamps.missing, ("frames missing", "chirps lost")),
    Test(sequence.repeated, ("frames frozen", "frames repeated"), whole=True),
    Test(disturbance.interference, ("interference",)),
    Test(disturbance.leakage, ("range bias",)),
    Test(orientation.standing, ("no motion",)),
    Test(array.band, ("board",)),
    Test(array.antennas, ("transmitter order", "receiver order", "board"), unless=STILL),
    Test(array.elevation, ("elevation missing",), unless=STILL),
    Test(sequence.shuffled, ("frames shuffled",), unless=STILL, whole=True),
    Test(sequence.reversed_, ("frames reversed",), unless=STILL),
    Test(sequence.cuts, ("cut and rejoined",), unless=(*STILL, "frames shuffled"), whole=True),
    Test(stamps.period, ("frame period",)),
    Test(stamps.chirps, ("chirp parameters",), unless=STILL),
    Test(orientation.upside_down, ("upside down",)),
    Test(orientation.mirrored, ("azimuth mirrored",), unless=(*STILL, "upside down")),
    Test(orientation.elevation_mirrored, ("elevation mirrored",), unless=(*STILL, "upside down")),
    Test(orientation.backwards, ("facing backwards",), unless=STILL),
)
#: All kinds of faults.
FAULTS = tuple(dict.fromkeys(kind for test in TESTS for kind in test.kinds))
