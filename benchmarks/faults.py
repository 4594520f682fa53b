"""Faults that are put into a whole recording in memory, and the kinds by which `radarize check` should name them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int16
from scipy.spatial.transform import Rotation

from benchmarks import hardships
from radarize.io.trajectory import Trajectory
from radarize.odometry.inertial import Imu
from radarize.pipeline.check.evidence import Evidence
from radarize.radar.boards import BOARDS, load_board
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import decode
from radarize.radar.noise import noise_floor, noise_profile


@dataclass(frozen=True)
class Walk:
    """A recording in memory.

    Attributes:
        config: of the radar.
        adc: I/Q.
        times: starts of frames, s.
        valid: False where a chirp was lost.
        truth: true poses; None without.
        imu: None without.
    """

    config: RadarConfig
    adc: Int16[np.ndarray, "frame loop tx rx sample 2"]
    times: Float[np.ndarray, "frame"]
    valid: Bool[np.ndarray, "frame loop tx"]
    truth: Trajectory | None = None
    imu: Imu | None = None

    @property
    def evidence(self) -> Evidence:
        """For a check."""
        return Evidence(self.config, self.times, self.valid, lambda a, b: self.adc[a:b], self.truth, self.imu)

    def of(self, frames: np.ndarray, stamped: bool = True) -> "Walk":
        """Other frames of it, with their stamps or with those of as many first frames."""
        times = self.times[frames] if stamped else self.times[: len(frames)]
        return replace(self, adc=self.adc[frames], times=times, valid=self.valid[frames])


Harm = Callable[[Walk, np.random.Generator], Walk | None]


class Fault(NamedTuple):
    """A fault.

    Attributes:
        kind: how it should be named; empty: it is none.
        harm: makes it of a whole walk; None where a radar cannot have it.
    """

    kind: str
    harm: Harm


def _signal(walk: Walk) -> np.ndarray:
    return walk.adc.astype(np.float32).view(np.complex64)[..., 0]


def _counts(signal: np.ndarray) -> np.ndarray:
    pairs = np.stack([signal.real, signal.imag], axis=-1)
    return np.clip(np.rint(pairs), -32768, 32767).astype(np.int16)


def _noise(walk: Walk, shape: tuple[int, ...], rng: np.random.Generator) -> np.ndarray:
    sigma = np.sqrt(noise_floor(noise_profile(_signal(replace(walk, adc=walk.adc[:8])))) / 2)
    return np.rint(sigma * rng.standard_normal(shape, np.float32)).astype(np.int16)


# --- no fault ---------------------------------------------------------------------------------------------------------
def plain(walk: Walk, rng: np.random.Generator) -> Walk:
    return walk


def hurt(harm: Callable) -> Harm:
    """A hardship, which is no fault."""

    def made(walk: Walk, rng: np.random.Generator) -> Walk:
        samples = harm(hardships.Samples(walk.adc, walk.times, walk.valid), rng)
        return replace(walk, adc=samples.adc, valid=samples.valid)

    return made


# --- words ------------------------------------------------------------------------------------------------------------
def exchanged_iq(walk: Walk, rng: np.random.Generator) -> Walk:
    return replace(walk, adc=np.ascontiguousarray(walk.adc[..., ::-1]))


def negated_q(walk: Walk, rng: np.random.Generator) -> Walk:
    return replace(walk, adc=walk.adc * np.array([1, -1], np.int16))


def offset_binary(walk: Walk, rng: np.random.Generator) -> Walk:
    return replace(walk, adc=walk.adc ^ np.int16(-32768))


def swapped_bytes(walk: Walk, rng: np.random.Generator) -> Walk:
    return replace(walk, adc=walk.adc.byteswap())


def _fired(walk: Walk) -> np.ndarray:
    iq = walk.adc[:, :, [walk.config.tx.index(t) for t in walk.config.tx_order]]
    return iq[..., ::-1] if walk.config.iq_order == "qqii" else iq


def interleaved(walk: Walk, rng: np.random.Generator) -> Walk:
    """Four lanes, read as two."""
    words = np.ascontiguousarray(_fired(walk).transpose(0, 1, 2, 4, 5, 3)).reshape(-1)
    return replace(walk, adc=decode(words, walk.config))


def alternating_iq(walk: Walk, rng: np.random.Generator) -> Walk:
    """I0 Q0 I1 Q1, read in pairs."""
    return replace(walk, adc=decode(np.ascontiguousarray(_fired(walk)).reshape(-1), walk.config))


def loops_inside(walk: Walk, rng: np.random.Generator) -> Walk:
    """All chirps of a transmitter before those of the next, read loop by loop."""
    fired = walk.adc[:, :, [walk.config.tx.index(t) for t in walk.config.tx_order]].swapaxes(1, 2)
    chirps = np.ascontiguousarray(fired).reshape(walk.adc.shape)
    return replace(walk, adc=np.ascontiguousarray(chirps[:, :, list(walk.config.slot)]))


# --- antennas ---------------------------------------------------------------------------------------------------------
def fired_otherwise(walk: Walk, rng: np.random.Generator) -> Walk:
    """Read as if transmitters had fired in the order of their numbers."""
    order = [walk.config.tx.index(t) for t in walk.config.tx_order]
    config = walk.config.model_copy(update={"tx_order": walk.config.tx})
    return replace(walk, adc=np.ascontiguousarray(walk.adc[:, :, order]), config=config)


def transmitters(*order: int) -> Harm:
    """The transmitters' axis in another order."""
    return lambda walk, rng: replace(walk, adc=np.ascontiguousarray(walk.adc[:, :, list(order)]))


def receivers(*order: int) -> Harm:
    """The receivers' axis in another order."""
    return lambda walk, rng: replace(walk, adc=np.ascontiguousarray(walk.adc[:, :, :, list(order)]))


def other_board(walk: Walk, rng: np.random.Generator) -> Walk | None:
    """Another one of the boards with an IWR6843 is configured."""
    sixty = [name for name, board in BOARDS.items() if board.chip == "iwr6843"]
    if str(walk.config.board) not in sixty:
        return None
    name = sixty[(sixty.index(str(walk.config.board)) + 1) % len(sixty)]
    return replace(walk, config=walk.config.changed("benchmark", board=name))


def _negated(config: RadarConfig, left: int, up: int) -> RadarConfig:
    board = load_board(config.board)
    places = {name: tuple((left * y, up * z) for y, z in getattr(board, name)) for name in ("tx", "rx")}
    return config.model_copy(update={"board": board.model_copy(update={"name": "other", **places})})


def mirrored(walk: Walk, rng: np.random.Generator) -> Walk:
    """A board's file with left and right exchanged; an IMU and true poses know better."""
    return replace(walk, config=_negated(walk.config, -1, 1))


def elevation_mirrored(walk: Walk, rng: np.random.Generator) -> Walk:
    """A board's file with up and down exchanged."""
    return replace(walk, config=_negated(walk.config, 1, -1))


def mirrored_blind(walk: Walk, rng: np.random.Generator) -> Walk:
    """The same where nothing else knows."""
    return replace(mirrored(walk, rng), imu=None, truth=None)


def upside_down(walk: Walk, rng: np.random.Generator) -> Walk | None:
    """Radar and IMU hang from the ceiling."""
    if walk.imu is None:
        return None
    turned = Imu.__new__(Imu)
    turned.__dict__.update(walk.imu.__dict__)
    turned.samples = walk.imu.samples * np.array([1, -1, -1, 1, -1, -1])
    return replace(walk, config=_negated(walk.config, -1, -1), imu=turned, truth=None)


def backwards(walk: Walk, rng: np.random.Generator) -> Walk:
    """True poses of a body whose radar looks back."""
    turn = Rotation.from_euler("z", 180, degrees=True)
    pose = walk.truth.pose.copy()
    pose[:, 3:] = (Rotation.from_quat(pose[:, 3:]) * turn).as_quat()
    return replace(walk, truth=Trajectory(walk.truth.time, pose, name="truth"), imu=None)


def level(walk: Walk, rng: np.random.Generator) -> Walk | None:
    """A board whose raised transmitter is not raised: it sees what the row sees at its place, at its own time."""
    if str(walk.config.board) not in ("iwr1843boost", "iwr6843isk"):
        return None
    config, signal = walk.config, _signal(walk)
    speeds = (np.fft.fftfreq(config.loops) * config.loops).reshape(-1, 1, 1)
    spectrum = np.fft.ifft(signal, axis=1)  # closing speeds ascend
    slots = config.slot
    for rx, (tx, other) in enumerate(((0, 2), (0, 3), (2, 0), (2, 1))):
        late = (slots[1] - slots[tx]) / len(slots) / config.loops
        spectrum[:, :, 1, rx] = spectrum[:, :, tx, other] * np.exp(-2j * np.pi * speeds[:, :, 0] * late)
    moved = np.fft.fft(spectrum, axis=1)
    adc = walk.adc.copy()
    adc[:, :, 1] = _counts(moved[:, :, 1])
    adc[:, :, 1] += _noise(walk, adc[:, :, 1].shape, rng)
    return replace(walk, adc=adc)


# --- channels ---------------------------------------------------------------------------------------------------------
def receiver_stuck(walk: Walk, rng: np.random.Generator) -> Walk:
    adc = walk.adc.copy()
    adc[:, :, :, 2] = adc[0, 0, 0, 2, 0]
    return replace(walk, adc=adc)


def receiver_copied(walk: Walk, rng: np.random.Generator) -> Walk:
    return receivers(0, 1, 1, 3)(walk, rng)


def receiver_saturated(walk: Walk, rng: np.random.Generator) -> Walk:
    """One whose converter ends at twice the standard deviation of what comes in."""
    adc = walk.adc.astype(np.int32)
    most = int(2 * adc[:, :, :, 1].std())
    adc[:, :, :, 1] = np.clip(adc[:, :, :, 1], -most, most)
    return replace(walk, adc=adc.astype(np.int16))


def transmitter_dead(walk: Walk, rng: np.random.Generator) -> Walk:
    adc = walk.adc.copy()
    adc[:, :, 2] = _noise(walk, adc[:, :, 2].shape, rng)
    return replace(walk, adc=adc)


def alike(walk: Walk, rng: np.random.Generator) -> Walk:
    return replace(walk, adc=np.broadcast_to(walk.adc[:, :, :1, :1], walk.adc.shape).copy())


def i_alone(walk: Walk, rng: np.random.Generator) -> Walk:
    return replace(walk, adc=walk.adc * np.array([1, 0], np.int16))


def i_twice(walk: Walk, rng: np.random.Generator) -> Walk:
    return replace(walk, adc=np.repeat(walk.adc[..., :1], 2, axis=-1))


def multiplied(walk: Walk, rng: np.random.Generator) -> Walk:
    return replace(walk, adc=np.clip(walk.adc.astype(np.int32) * 4, -32768, 32764).astype(np.int16))


def divided(walk: Walk, rng: np.random.Generator) -> Walk:
    return replace(walk, adc=walk.adc // 32)


def silent(walk: Walk, rng: np.random.Generator) -> Walk:
    return replace(walk, adc=np.zeros_like(walk.adc))


def noise(walk: Walk, rng: np.random.Generator) -> Walk:
    return replace(walk, adc=_noise(walk, walk.adc.shape, rng))


def still(walk: Walk, rng: np.random.Generator) -> Walk:
    """A radar that stands: a chirp again and again, with other noise."""
    adc = np.broadcast_to(walk.adc[:1, :1], walk.adc.shape)
    return replace(walk, adc=adc + _noise(walk, walk.adc.shape, rng), truth=None)


def delayed(metres: float) -> Harm:
    """All echoes, and the leakage, by so much too far away."""

    def harm(walk: Walk, rng: np.random.Generator) -> Walk:
        turn = np.exp(2j * np.pi * metres / walk.config.max_range * np.arange(walk.config.samples)).astype(np.complex64)
        return replace(walk, adc=_counts(_signal(walk) * turn))

    return harm


def biased(metres: float) -> Harm:
    """A range bias is configured that is none."""
    return lambda walk, rng: replace(walk, config=walk.config.changed("benchmark", range_bias=metres))


# --- time -------------------------------------------------------------------------------------------------------------
def stamps(step: Callable[[RadarConfig], float]) -> Harm:
    """Frames so many s apart, by their stamps."""
    return lambda walk, rng: replace(walk, times=walk.times[0] + step(walk.config) * np.arange(len(walk.times)))


def configured(**factors: float) -> Harm:
    """Fields of the configuration with wrong values, by factors."""

    def harm(walk: Walk, rng: np.random.Generator) -> Walk:
        fields = {name: factor * getattr(walk.config, name) for name, factor in factors.items()}
        return replace(walk, config=walk.config.changed("benchmark", **fields))

    return harm


def frames_missing(walk: Walk, rng: np.random.Generator) -> Walk:
    return walk.of(np.delete(np.arange(len(walk.adc)), rng.integers(5, len(walk.adc) - 5, 5)))


def chirps_lost(walk: Walk, rng: np.random.Generator) -> Walk:
    valid = walk.valid & (rng.random(walk.valid.shape) >= 0.02)
    return replace(walk, adc=walk.adc * valid[..., None, None, None], valid=valid)


def frame_frozen(walk: Walk, rng: np.random.Generator) -> Walk:
    """One frame, from the middle on."""
    return replace(walk, adc=walk.adc[np.minimum(np.arange(len(walk.adc)), len(walk.adc) // 2)])


def frames_twice(walk: Walk, rng: np.random.Generator) -> Walk:
    """Every tenth frame holds the one before."""
    frames = np.arange(len(walk.adc))
    return replace(walk, adc=walk.adc[frames - (frames % 10 == 9)])


def two_seconds_again(walk: Walk, rng: np.random.Generator) -> Walk:
    frames = np.arange(len(walk.adc))
    two = round(2 / walk.config.frame_period)
    start = int(rng.integers(two, len(frames) - two))
    frames[start : start + two] -= two
    return replace(walk, adc=walk.adc[frames])


def shuffled(walk: Walk, rng: np.random.Generator) -> Walk:
    """Within blocks of eight."""
    frames = np.arange(len(walk.adc) // 8 * 8).reshape(-1, 8)
    return walk.of(rng.permuted(frames, axis=1).ravel(), stamped=False)


def pairs_exchanged(walk: Walk, rng: np.random.Generator) -> Walk:
    frames = np.arange(len(walk.adc) // 2 * 2).reshape(-1, 2)
    return walk.of(frames[:, ::-1].ravel(), stamped=False)


def reversed_(walk: Walk, rng: np.random.Generator) -> Walk:
    return walk.of(np.arange(len(walk.adc))[::-1], stamped=False)


def rejoined(walk: Walk, rng: np.random.Generator) -> Walk:
    """Two seconds are cut out, and stamps go on."""
    two, frames = round(2 / walk.config.frame_period), np.arange(len(walk.adc))
    start = int(rng.integers(len(frames) // 4, max(len(frames) - 2 * two, len(frames) // 4 + 1)))
    return walk.of(np.delete(frames, slice(start, start + two)), stamped=False)


def teleported(walk: Walk, rng: np.random.Generator) -> Walk:
    """The second half comes first."""
    return walk.of(np.roll(np.arange(len(walk.adc)), len(walk.adc) // 2), stamped=False)


#: By name; those without a kind are none.
FAULTS: dict[str, Fault] = {
    "none": Fault("", plain),
    "none; phases off by 20 deg": Fault("", hurt(hardships.phases_off(20.0))),
    "none; gains off by 1 dB": Fault("", hurt(hardships.gains_off)),
    "none; noise + 6 dB": Fault("", hurt(hardships.noisier)),
    "I and Q exchanged": Fault("I and Q", exchanged_iq),
    "Q negated": Fault("I and Q", negated_q),
    "offset binary": Fault("offset-binary samples", offset_binary),
    "bytes exchanged": Fault("byte order", swapped_bytes),
    "four lanes read as two": Fault("layout", interleaved),
    "I Q I Q read as I I Q Q": Fault("layout of I and Q", alternating_iq),
    "transmitter before loop": Fault("loops and chirps", loops_inside),
    "TX1, TX2, TX3 for TX1, TX3, TX2": Fault("transmitter order", fired_otherwise),
    "TX2 and TX3 exchanged": Fault("transmitter order", transmitters(0, 2, 1)),
    "TX3, TX1, TX2": Fault("transmitter order", transmitters(2, 0, 1)),
    "RX1 and RX2 exchanged": Fault("receiver order", receivers(1, 0, 2, 3)),
    "receivers reversed": Fault("receiver order", receivers(3, 2, 1, 0)),
    "RX3, RX1, RX4, RX2": Fault("receiver order", receivers(2, 0, 3, 1)),
    "another board": Fault("board", other_board),
    "azimuth mirrored; IMU and poses": Fault("azimuth mirrored", mirrored),
    "azimuth mirrored; radar alone": Fault("azimuth mirrored", mirrored_blind),
    "elevation mirrored; poses": Fault("elevation mirrored", elevation_mirrored),
    "upside down, with its IMU": Fault("upside down", upside_down),
    "facing backwards; poses": Fault("facing backwards", backwards),
    "TX2 not raised": Fault("elevation missing", level),
    "receiver dead": Fault("receiver dead", hurt(hardships.receiver_dead)),
    "receiver stuck": Fault("receiver dead", receiver_stuck),
    "receiver copied": Fault("receiver copied", receiver_copied),
    "receiver saturated": Fault("receiver saturated", receiver_saturated),
    "transmitter dead": Fault("transmitter dead", transmitter_dead),
    "all channels identical": Fault("channels identical", alike),
    "I alone": Fault("I without Q", i_alone),
    "I twice": Fault("I without Q", i_twice),
    "samples times 4": Fault("samples scaled", multiplied),
    "samples over 32": Fault("samples scaled", divided),
    "silence": Fault("no signal", silent),
    "noise": Fault("pure noise", noise),
    "radar at rest": Fault("no motion", still),
    "range + 0.25 m": Fault("range bias", delayed(0.25)),
    "range bias of 0.25 m configured": Fault("range bias", biased(0.25)),
    "interference in 1 %": Fault("interference", hurt(hardships.interference(0.01))),
    "interference in 5 %": Fault("interference", hurt(hardships.interference(0.05))),
    "stamps 1 ns apart": Fault("stamps too dense", stamps(lambda config: 1e-9)),
    "stamps 0.3 ms apart": Fault("stamps too dense", stamps(lambda config: 0.3e-3)),
    "stamps at twice the period": Fault("frame period", stamps(lambda config: 2 * config.frame_period)),
    "frame period 1.3 times": Fault("frame period", configured(frame_period=1.3)),
    "slope 1.25 times": Fault("chirp parameters", configured(slope=1.25)),
    "idle time 0.6 times": Fault("chirp parameters", configured(idle_time=0.6)),
    "five frames missing": Fault("frames missing", frames_missing),
    "2 % of chirps lost": Fault("chirps lost", chirps_lost),
    "a frame frozen": Fault("frames frozen", frame_frozen),
    "every tenth frame twice": Fault("frames frozen", frames_twice),
    "two seconds again": Fault("frames repeated", two_seconds_again),
    "frames shuffled by eight": Fault("frames shuffled", shuffled),
    "pairs of frames exchanged": Fault("frames shuffled", pairs_exchanged),
    "frames reversed": Fault("frames reversed", reversed_),
    "two seconds cut out": Fault("cut and rejoined", rejoined),
    "halves exchanged": Fault("cut and rejoined", teleported),
}
