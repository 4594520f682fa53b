"""Faults in the assignment of antennas: order of transmitters and of receivers, and the board.

An echo is a plane wave over the virtual array. If antennas are exchanged it is none, and no direction explains the
channels: in furnished rooms a third to a half of the cells are single plane waves (90 % of their power) with the
correct array, at most half as many with any other. The test compares cell by cell how well the configured array and
another one explain it.
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
from radarize.radar.boards import BOARDS, Board, likely_board, load_board
from radarize.radar.config import RadarConfig, fired, firing_name
from radarize.radar.limits import covers, outside_band

#: Standard deviations by which another array must explain the cells better; minimum number of cells and of frames.
_SIGMAS, _CELLS, _FRAMES = 6.0, 150, 8
#: Minimum share of cells that are plane waves with the better array, and its ratio to that with the configured one.
_SHARE, _MORE = 0.08, 1.25
#: Purity from which on a cell is a plane wave; exponent that gives nearly pure cells some weight.
_PURE, _SHARP = 0.9, 8
#: Standard deviation of elevation direction cosines below which the array measures no elevation; 0.1 to 0.3 in rooms.
_LEVEL = 0.03
#: Standard deviations by which arrays may differ that explain the echoes equally well because they are mirror images.
_EQUAL = 1.5
#: Maximum number of cells that other arrays are tried on; every N-th of them is used to reject arrays that explain
#: these worse by this many standard deviations.
_TRIED, _FEW, _HOPELESS = 800, 5, -2.0
#: Maximum number of antennas of an axis of which all orders are tried.
_ALL = 4
#: Hz, boundary between the frequency bands within which boards are mistaken for each other.
_BAND = 70e9


@dataclass(frozen=True, eq=False)
class Candidate:
    """Another array that may explain the echoes.

    Attributes:
        kind: kind of the fault.
        words: description of the fault.
        remedy: what corrects it.
        reading: assignment of channels to antennas.
        correction: correction of the samples.
    """

    kind: str
    words: str
    remedy: str
    reading: Reading
    correction: Correction


def candidates(config: RadarConfig) -> Iterator[Candidate]:
    """Yield all arrays that may be mistaken for the configured one."""
    names = [firing_name(firing) for firing in config.tx]
    for order in _orders(len(config.tx)):
        inverse = list(np.argsort(order))
        slots = [config.slot[k] for k in inverse]  # of physical transmitters, if chirps keep their places
        firings = tuple(config.tx[k] for k in np.argsort(slots))
        tx = ",".join("+".join(str(t + 1) for t in fired(firing)) for firing in firings)
        change = Correction(config.model_copy(update={"tx_order": firings}), _taken(2, inverse))
        wrong = ", ".join(f"{names[order[k]]} in place of {names[k]}" for k in range(len(order)) if order[k] != k)
        yield Candidate(
            "transmitter order",
            wrong,
            f"import it with --tx {tx}, the order of firing",
            Reading.of(config, tx=order),
            change,
        )
        yield Candidate(
            "transmitter order", wrong, "reorder the transmitters' axis", Reading.of(config, tx=order, moved=True),
            Correction(samples=_taken(2, inverse)),
        )  # fmt: skip
    for order in _orders(len(config.rx)):
        wrong = ", ".join(
            f"RX{config.rx[order[k]] + 1} in place of RX{config.rx[k] + 1}" for k in range(len(order)) if order[k] != k
        )
        correction = Correction(samples=_taken(3, list(np.argsort(order))))
        yield Candidate(
            "receiver order", wrong, "reorder the receivers' axis", Reading.of(config, rx=order), correction
        )
    for names in _other_boards(config):
        try:
            other = config.changed("check", board=names[0])
        except InputError:
            continue
        words = f"the antennas of the {names[0]} instead of those of the {load_board(config.board)}"
        yield Candidate("board", words, _import_with(names), Reading.of(other), Correction(other))


def _orders(count: int) -> list[tuple[int, ...]]:
    """Return possible orders of antennas: all of a few; of more, each pair exchanged, or all reversed."""
    ordered = tuple(range(count))
    if count <= _ALL:
        return [each for each in permutations(ordered) if each != ordered]
    exchanged = [tuple({i: j, j: i}.get(k, k) for k in ordered) for i, j in combinations(ordered, 2)]
    return [*exchanged, ordered[::-1]]


def _taken(axis: int, order: list[int]) -> Callable[[np.ndarray], np.ndarray]:
    return lambda frames: np.ascontiguousarray(np.take(frames, order, axis=axis))


def _other_boards(config: RadarConfig) -> list[list[str]]:
    """Return the boards of the band whose array is another one, grouped by equal arrays; the likeliest comes first."""
    configured, groups = _array(load_board(config.board)), dict[tuple, list[str]]()
    high = config.start_frequency > _BAND
    for name in sorted(BOARDS, key=lambda name: _unlikely(name, config)):
        if (BOARDS[name].design_frequency > _BAND) == high and (array := _array(BOARDS[name])) != configured:
            groups.setdefault(array, []).append(name)
    return list(groups.values())


def _array(board: Board) -> tuple:
    return board.tx, board.rx, board.tx_sign, board.rx_sign


def _unlikely(name: str, config: RadarConfig) -> tuple[bool, bool]:
    """Sort key of boards: first those of the configuration's frequency, of these the most common one."""
    return not covers(BOARDS[name], config.start_frequency), name != likely_board(config.start_frequency)


def _import_with(names: list[str]) -> str:
    """Remedy that names a board and those with the same antennas."""
    first, *others = names
    same = f" (the same antennas: {', '.join(others)})" if others else ""
    return f"import it with --board {first}{same}"


def band(evidence: Evidence) -> Iterator[Finding]:
    """Find a board that does not have the start frequency. Another one with the same antennas corrects it."""
    config = evidence.config
    if outside := outside_band(config):
        names = [name for name in BOARDS if covers(BOARDS[name], config.start_frequency)]
        names.sort(key=lambda name: _unlikely(name, config))
        if same := [name for name in names if _array(BOARDS[name]) == _array(load_board(config.board))]:
            yield Finding("board", outside, 1.0, _import_with(same), Correction(config.changed("check", board=same[0])))
        else:
            wanted = f"the board that was used, such as {', '.join(names)}" if names else "the file of the board"
            yield Finding("board", outside, 1.0, f"import it with --board and {wanted}")


def plane_waves(evidence: Evidence) -> PlaneWaves:
    """Return the evidence's cells as plane waves over the configured array.

    Raises:
        NotObservable: there are too few channels, frames or cells.
    """
    config = evidence.config
    if len(config.tx) * len(config.rx) < 4:
        raise NotObservable(f"{len(config.tx) * len(config.rx)} channels fit plane waves in any order")
    frames = len(np.unique(evidence.cells.frame))
    if frames < _FRAMES:
        raise NotObservable(f"{frames} frames have echoes, {_FRAMES} are needed")
    if len(evidence.cells.speed) < _CELLS:
        raise NotObservable(f"{len(evidence.cells.speed)} echoes were found, {_CELLS} are needed")
    return evidence.waves


def antennas(evidence: Evidence) -> Iterator[Finding]:
    """Find antennas that are elsewhere than configured."""
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
        raise NotObservable(
            f"{max(now, pure):.0%} of the echoes are plane waves with any array, {_SHARE:.0%} are needed"
        )
    if best is not None and margin > _SIGMAS and pure > _MORE * now:
        best = _upright([each for sigmas, _, each in tried if sigmas > margin - _EQUAL], best, evidence)
        yield Finding(
            best.kind, f"{pure:.0%} of the echoes are plane waves with {best.words}, {now:.0%} as configured",
            sureness(margin, _SIGMAS), best.remedy, best.correction, hides=True,
        )  # fmt: skip


def _sigmas(waves: PlaneWaves, purity: np.ndarray) -> float:
    """Return by how many standard deviations plane waves explain cells better than with some purity."""
    better = waves.purity**_SHARP - purity**_SHARP
    return float(better.mean() / (better.std() + 1e-9) * np.sqrt(len(better)))


def _upright(rivals: list[Candidate], best: Candidate, evidence: Evidence) -> Candidate:
    """Return one of several arrays that are mirror images and explain echoes equally well: one that IMU or poses
    confirm.

    On the IWR1843, reversed receivers are the mirror image of exchanged outer transmitters.
    """
    for rival in sorted(rivals, key=lambda each: each is not best):
        try:
            if not list(mirrored(evidence.corrected(rival.correction))):
                return rival
        except NotObservable:
            break
    return best


def elevation(evidence: Evidence) -> Iterator[Finding]:
    """Find an array with antennas at two heights that measures no elevation."""
    waves = plane_waves(evidence)
    if not np.ptp(evidence.reading.places[..., 1]):
        raise NotObservable("all antennas are at the same height")
    pure = waves.purity > _PURE
    if pure.sum() < _CELLS / 3:
        raise NotObservable(f"{pure.sum()} echoes are plane waves, {_CELLS // 3} are needed")
    spread = float(waves.direction[pure, 1].std())
    if spread < _LEVEL:
        yield Finding(
            "elevation missing", f"elevation cosines of {pure.sum()} echoes have a standard deviation of {spread:.3f}",
            sureness(_LEVEL / max(spread, 1e-3), 1.0),
            "check the board file (--board): its antennas may all be at the same height",
        )  # fmt: skip
