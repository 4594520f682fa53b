"""Faults of which antenna is which: order of transmitters and of receivers, and the board.

An echo is a plane wave over the virtual array. If antennas are taken for one another it is none, and no direction
explains what the channels read: in furnished rooms a third to a half of the cells are single plane waves (90 % of their
power) by the right array, half as many at most by any other one. The test pairs cells: each is explained better or
worse by another array than by the one of the configuration.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np

from radarize.io.errors import InputError
from radarize.pipeline.check.evidence import Evidence
from radarize.pipeline.check.finding import Correction, Finding, NotObservable
from radarize.pipeline.check.levels import sureness
from radarize.pipeline.check.orientation import mirrored
from radarize.pipeline.check.planewaves import PlaneWaves, Reading, fit_plane_waves
from radarize.radar.boards import BOARDS, load_board
from radarize.radar.config import RadarConfig, fired, firing_name

#: Standard deviations by which another array must explain the cells better; cells, and frames, that are needed.
_SIGMAS, _CELLS, _FRAMES = 6.0, 150, 8
#: Share of cells that are plane waves by the better array at least, and by what factor more than by the configured one.
_SHARE, _MORE = 0.08, 1.25
#: Purity of a plane wave; exponent that lets nearly pure cells count.
_PURE, _SHARP = 0.9, 8
#: Standard deviation of direction cosines upward below which nothing is seen above or below: 0.1 to 0.3 in rooms.
_LEVEL = 0.03
#: Standard deviations by which arrays that explain the same, being mirror images, may differ.
_ALIKE = 1.5
#: Cells that other arrays are tried on, at most; every N-th of them is enough for those that explain these worse by so
#: many standard deviations.
_TRIED, _FEW, _HOPELESS = 800, 5, -2.0
#: Antennas of an axis, at most, of which every order is tried.
_ALL = 4
#: Hz: bands in which boards are taken for one another.
_BAND = 70e9


@dataclass(frozen=True, eq=False)
class Candidate:
    """Another array.

    Attributes:
        kind: of the fault that it would be.
        words: what would be wrong.
        remedy: what would correct it.
        reading: of the channels.
        correction: of the samples.
    """

    kind: str
    words: str
    remedy: str
    reading: Reading
    correction: Correction


def candidates(config: RadarConfig) -> Iterator[Candidate]:
    """All arrays that the configured one may be mistaken for."""
    names = [firing_name(firing) for firing in config.tx]
    for order in _orders(len(config.tx)):
        inverse = list(np.argsort(order))
        slots = [config.slot[k] for k in inverse]  # of physical transmitters, if chirps stayed where they are
        firings = tuple(config.tx[k] for k in np.argsort(slots))
        tx = ",".join("+".join(str(t + 1) for t in fired(firing)) for firing in firings)
        change = Correction(config.model_copy(update={"tx_order": firings}), _taken(2, inverse))
        held = ", ".join(f"{names[order[k]]} in place of {names[k]}" for k in range(len(order)) if order[k] != k)
        yield Candidate(
            "transmitter order",
            held,
            f"import it with --tx {tx}, the order of firing",
            Reading.of(config, tx=order),
            change,
        )
        yield Candidate(
            "transmitter order", held, "reorder the transmitters' axis", Reading.of(config, tx=order, moved=True),
            Correction(samples=_taken(2, inverse)),
        )  # fmt: skip
    for order in _orders(len(config.rx)):
        held = ", ".join(
            f"RX{config.rx[order[k]] + 1} in place of RX{config.rx[k] + 1}" for k in range(len(order)) if order[k] != k
        )
        correction = Correction(samples=_taken(3, list(np.argsort(order))))
        yield Candidate("receiver order", held, "reorder the receivers' axis", Reading.of(config, rx=order), correction)
    band = config.start_frequency > _BAND
    for name, board in BOARDS.items():
        if (board.design_frequency > _BAND) != band or _alike(config, name):
            continue
        try:
            other = config.changed("check", board=name)
        except InputError:
            continue
        words = f"channels fit the {name}, not the {load_board(config.board)}"
        yield Candidate("board", words, f"import it with --board {name}", Reading.of(other), Correction(other))


def _orders(count: int) -> list[tuple[int, ...]]:
    """Orders in which antennas may stand instead: all of a few; of more, two exchanged, or all reversed."""
    ordered = tuple(range(count))
    if count <= _ALL:
        return [each for each in permutations(ordered) if each != ordered]
    exchanged = [tuple({i: j, j: i}.get(k, k) for k in ordered) for i, j in combinations(ordered, 2)]
    return [*exchanged, ordered[::-1]]


def _taken(axis: int, order: list[int]) -> Callable[[np.ndarray], np.ndarray]:
    return lambda frames: np.ascontiguousarray(np.take(frames, order, axis=axis))


def _alike(config: RadarConfig, name: str) -> bool:
    one, other = load_board(config.board), load_board(name)
    return (one.tx, one.rx, one.tx_sign, one.rx_sign) == (other.tx, other.rx, other.tx_sign, other.rx_sign)


def plane_waves(evidence: Evidence) -> PlaneWaves:
    """Of the evidence's cells by its configuration.

    Raises:
        NotObservable: there are too few channels, frames or cells.
    """
    config = evidence.config
    if len(config.tx) * len(config.rx) < 4:
        raise NotObservable(f"{len(config.tx) * len(config.rx)} channels are plane waves in any order")
    frames = len(np.unique(evidence.cells.frame))
    if frames < _FRAMES:
        raise NotObservable(f"{frames} frames have echoes, {_FRAMES} are needed")
    if len(evidence.cells.speed) < _CELLS:
        raise NotObservable(f"{len(evidence.cells.speed)} echoes are seen, {_CELLS} are needed")
    return evidence.waves


def antennas(evidence: Evidence) -> Iterator[Finding]:
    """Antennas stand elsewhere than the configuration says."""
    plane_waves(evidence)
    cells = evidence.cells
    cells = cells.where(np.arange(0, len(cells.speed), max(1, -(-len(cells.speed) // _TRIED))))
    here = fit_plane_waves(cells, evidence.reading)
    few = np.arange(0, len(cells.speed), _FEW)
    tried = []
    for candidate in candidates(evidence.config):
        if _sigmas(fit_plane_waves(cells.where(few), candidate.reading), here.purity[few]) < _HOPELESS:
            continue
        waves = fit_plane_waves(cells, candidate.reading)
        tried.append((_sigmas(waves, here.purity), float((waves.purity > _PURE).mean()), candidate))
    now = float((here.purity > _PURE).mean())
    margin, pure, best = max(tried, key=lambda each: each[0], default=(0.0, 0.0, None))
    if max(now, pure) < _SHARE:
        raise NotObservable(f"{max(now, pure):.0%} of the echoes are plane waves by any array, {_SHARE:.0%} are needed")
    if best is not None and margin > _SIGMAS and pure > _MORE * now:
        best = _upright([each for sigmas, _, each in tried if sigmas > margin - _ALIKE], best, evidence)
        yield Finding(
            best.kind, f"{pure:.0%} of the echoes are plane waves with {best.words}, {now:.0%} as configured",
            sureness(margin, _SIGMAS), best.remedy, best.correction, hides=True,
        )  # fmt: skip


def _sigmas(waves: PlaneWaves, purity: np.ndarray) -> float:
    """Standard deviations by which they explain cells better than with some purity."""
    better = waves.purity**_SHARP - purity**_SHARP
    return float(better.mean() / (better.std() + 1e-9) * np.sqrt(len(better)))


def _upright(rivals: list[Candidate], best: Candidate, evidence: Evidence) -> Candidate:
    """Of arrays that explain echoes equally well, mirror images of each other, one that an IMU or poses agree with.

    On the IWR1843, receivers in reverse order are the mirror image of exchanged outer transmitters.
    """
    for rival in sorted(rivals, key=lambda each: each is not best):
        try:
            if not list(mirrored(evidence.corrected(rival.correction))):
                return rival
        except NotObservable:
            break
    return best


def elevation(evidence: Evidence) -> Iterator[Finding]:
    """An array with antennas at two heights sees everything at its own height."""
    waves = plane_waves(evidence)
    if not np.ptp(evidence.reading.places[..., 1]):
        raise NotObservable("all antennas are at one height")
    pure = waves.purity > _PURE
    if pure.sum() < _CELLS / 3:
        raise NotObservable(f"{pure.sum()} echoes are plane waves, {_CELLS // 3} are needed")
    spread = float(waves.direction[pure, 1].std())
    if spread < _LEVEL:
        yield Finding(
            "elevation missing", f"directions upward of {pure.sum()} echoes have a standard deviation of {spread:.3f}",
            sureness(_LEVEL / max(spread, 1e-3), 1.0),
            "look at the board's file: its antennas may all be at one height (--board)",
        )  # fmt: skip
