"""Python interface of live processing: the pipeline on a radar, or on a recording in real time, frame by frame."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, fields
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

import numpy as np
import torch
from jaxtyping import Bool, Float, Int16

from radarize.capture.board import NetworkAddresses
from radarize.capture.live import Live, prepare
from radarize.capture.page import LivePage, Unwatched
from radarize.capture.record import Keeper, recording
from radarize.capture.replay import Replay
from radarize.capture.sensor import Sensor
from radarize.capture.stream import FrameStream
from radarize.capture.uart import BAUD
from radarize.io.errors import InputError, refuse_unknown
from radarize.io.recording import spare
from radarize.pipeline.config import Configuration
from radarize.pipeline.method import Inputs, Weights
from radarize.pipeline.methods import choose_methods, pace
from radarize.pipeline.odometry import configuration
from radarize.pipeline.pipeline import Result
from radarize.pipeline.runfolder import OccupancyMap
from radarize.radar.config import RadarConfig
from radarize.radar.presets import load_config
from radarize.signal.bearings import BEARINGS

if TYPE_CHECKING:
    from radarize.evaluation.foxglove import Server


class LiveOptions(TypedDict, total=False):
    """Options of ``radarize live``: access to the radar, settings of the methods, further outputs."""

    weights: str | Path | None
    pipeline: Configuration | str | Path | None
    baud: int
    host: str
    dca: str
    command_port: int
    data_port: int
    output: str | Path | None
    overwrite: bool
    address: str | None
    foxglove: str | None
    board: str | Path | None


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """Result of a frame just received. ``rz.range_azimuth(frame)`` and similar functions make maps and points of it.

    Attributes:
        number: number of the frame.
        time: s, centre of its burst.
        pose: (3,) x, y (m), yaw (rad) on the current map.
        velocity: (2,) m/s in the sensor's frame: forward, left.
        ranges: (88,) the scan, m, inf without a return, on `azimuths`.
        samples: (1, loop, tx, rx, sample, 2) raw I/Q, ADC counts.
        valid: (1, loop, tx) False where samples were lost.
        times: (1,) s, start of its first chirp.
        config: radar configuration.
        session: its session.
    """

    number: int
    time: float
    pose: Float[np.ndarray, "3"]
    velocity: Float[np.ndarray, "2"]
    ranges: Float[np.ndarray, "bearing"]
    samples: Int16[np.ndarray, "1 loop tx rx sample 2"]
    valid: Bool[np.ndarray, "1 loop tx"]
    times: Float[np.ndarray, "1"]
    config: RadarConfig
    session: "LiveSession"

    #: rad, bearings of `ranges`, positive to the left.
    azimuths = BEARINGS
    alone = True

    def __len__(self) -> int:
        return 1

    def __getitem__(self, _: slice) -> "LiveFrame":
        return self

    def __repr__(self) -> str:
        x, y, yaw = self.pose
        return f"<frame {self.number} at {self.time:.3f} s: x {x:.2f} m, y {y:.2f} m, yaw {yaw:.2f} rad>"

    @property
    def numbers(self) -> range:
        """Range with the number of the frame only."""
        return range(self.number, self.number + 1)

    @property
    def map(self) -> OccupancyMap:
        """Current map, drawn on first use."""
        return self.session.map


class LiveSession:
    """Frames of a stream with the pipeline's results: ``for frame in session``. Leaving the loop stops the radar. A
    context manager, if `url` is needed before the first frame.

    Attributes:
        stream: the radar or the replay.
        methods: odometry and scans by name.
        most: number of frames after which it ends; None: no limit.
        live: the pipeline, once entered.
        server: Foxglove server, once entered; None without one.
    """

    live: Live
    server: "Server | None" = None

    def __init__(
        self, stream: FrameStream, inputs: Inputs, methods: dict[str, str], most: int | None, options: LiveOptions
    ):
        self.stream, self.methods, self.most = stream, methods, most
        self._threads = torch.get_num_threads()  # `prepare` sets it to one
        self._inputs, self._options, self._stack = prepare(inputs, methods), options, ExitStack()
        self._keeper: Keeper | None = None
        self._final_warnings: list[str] = []
        self._entered = False

    def __enter__(self) -> "LiveSession":
        given = self._options
        with ExitStack() as stack:
            if foxglove := given.get("foxglove"):
                from radarize.evaluation.foxglove import Server

                self.server = stack.enter_context(Server(foxglove))
            address = given.get("address")
            page = Unwatched() if address is None else stack.enter_context(LivePage(address))
            self.live = Live(self._inputs, self.methods, page, self.server)
            stack.enter_context(self.stream)
            if output := given.get("output"):
                overwrite = given.get("overwrite", False)
                self._keeper = stack.enter_context(recording(self.stream, Path(output), overwrite))
            self._stack, self._entered = stack.pop_all(), True
        return self

    def __exit__(self, *error: Any) -> None:
        if error[0] is None:
            self._final_warnings = self.warnings  # while the board still answers
        self._entered = False
        torch.set_num_threads(self._threads)
        self._stack.__exit__(*error)

    def __iter__(self) -> Iterator[LiveFrame]:
        if self._entered:
            yield from self.frames()
            return
        with self:
            try:
                yield from self.frames()
            except GeneratorExit:  # leaving the loop ends the stream and completes its recording
                return

    def frames(
        self, stopping: Event | None = None, progress: Callable[[int, int], None] = lambda done, total: None
    ) -> Iterator[LiveFrame]:
        """Yield the frames of an entered session that odometry uses.

        Args:
            stopping: event that ends the session; frames already received are still processed.
            progress: called with (frames done, total frames, 0 if unknown).

        Raises:
            InputError: no frames arrive, or the stream fails.
        """
        pushed = self.live.follow(
            self.stream, stopping or Event(), frames=self.most, keeper=self._keeper, progress=progress
        )
        for came, result in pushed:
            yield from self._frames(came, result)

    def _frames(self, came: np.ndarray, result: Result) -> Iterator[LiveFrame]:
        track, period = result.track, self.stream.config.burst_center
        rows = np.searchsorted(came["time"] + period, track.time)
        pose = self.live.view.pose()
        assert pose is not None
        for k, row in enumerate(rows):
            one = came[row : row + 1]
            yield LiveFrame(
                int(result.frames[k]), float(track.time[k]), pose, track.velocity[k], result.ranges[k].astype(float),
                one["adc"], one["valid"], one["time"], self.stream.config, self,
            )  # fmt: skip

    @property
    def url(self) -> str | None:
        """Address of the page, once entered; None without one."""
        return getattr(self.live.page, "url", None)

    @property
    def map(self) -> OccupancyMap:
        """Current map."""
        return OccupancyMap.of(self.live.pipeline.slam.map())

    @property
    def warnings(self) -> list[str]:
        """Warnings on the stream, its recording, and intervals of poor odometry, so far."""
        if not self._entered:
            return self._final_warnings
        return [*self.live.troubles(self.stream), *self.live.losses.warnings(), *self.live.pipeline.slam.warnings()]


def live(
    config: str | Path | RadarConfig | None = None,
    *,
    port: str | None = None,
    replay: str | Path | None = None,
    odometry: str | None = None,
    scans: str | None = None,
    every: int | None = None,
    duration: float | None = None,
    frames: int | None = None,
    **options: Unpack[LiveOptions],
) -> LiveSession:
    """Run the pipeline on a real radar (IWR1843BOOST with a DCA1000), or on a recording in real time.

    Frames are received in a process of their own, so a script needs an ``if __name__ == "__main__"``; a notebook needs
    nothing.

    Args:
        config: radar configuration: a preset, a ``.cfg`` file, or a `RadarConfig`.
        port: the radar's serial command port.
        replay: a recording (``.h5``) to play instead of a radar.
        odometry, scans: methods by name, see `run`.
        every: use every N-th frame; default: as in the networks' training.
        duration: end after this time, s.
        frames: end after this number of frames.
        options: ``weights``: folder of the networks' weights, default: those of the package; ``pipeline``: its
            settings, or a YAML file of them, as ``config`` of `run`; ``baud`` of the port; ``host`` (this computer),
            ``dca``, ``command_port`` and ``data_port`` of the DCA1000; ``output``: record as well (``.h5``),
            ``overwrite`` an existing one; ``address`` (``HOST:PORT``) of a local page with the live view, ``foxglove``
            of a server for Foxglove; ``board``: file of the board with its calibration, see `calibrate`.

    Returns:
        A session to iterate over: a `LiveFrame` for each frame that odometry uses, with pose, velocity and scan.
        Leaving the loop stops the radar.

    Raises:
        InputError: neither radar nor recording, or an error of the radar, the board, or the recording.

    Example:
        >>> for frame in rz.live(replay="walk.h5", odometry="doppler", scans="first-echo", frames=8):
        ...     pose, power = frame.pose, rz.range_azimuth(frame)
        >>> frame.number, pose.shape, power.dims
        (7, (3,), ('range', 'azimuth'))
    """
    refuse_unknown(options, LiveOptions)
    if (output := options.get("output")) and not options.get("overwrite"):
        spare(Path(output), anything=True)
    if replay and (config or port):
        raise InputError(f"--replay {replay} is given with --config or --port, expected one of the two")
    stream = Replay(Path(replay)) if replay else sensor(config, port, options)
    if board := options.get("board"):
        stream.config = stream.config.changed(str(board), board=board)
    radar = stream.config
    weights = options.get("weights")
    methods, _ = choose_methods(radar, odometry, scans, own_weights=bool(weights))
    every = every or pace(methods["odometry"], radar)
    inputs = Inputs(radar, configuration(options.get("pipeline")), Weights(weights), every=every)
    return LiveSession(stream, inputs, methods, frames_within(duration, frames, radar.frame_period), options)


def sensor(config: str | Path | RadarConfig | None, port: str | None, options: LiveOptions) -> Sensor:
    """Connect a radar on its serial port, and its capture card.

    Raises:
        InputError: no configuration or port, or see `Sensor`.
    """
    if config is None or port is None:
        name, wanted = ("config", "a .cfg or a preset") if config is None else ("port", "a TTY")
        raise InputError(f"--{name} is missing, expected {wanted}")
    radar, text = load_config(config)
    known = {each.name for each in fields(NetworkAddresses)}
    addresses: dict[str, Any] = {name: value for name, value in options.items() if name in known}
    return Sensor(radar, text, str(config), port, baud=options.get("baud", BAUD), network=NetworkAddresses(**addresses))


def frames_within(duration: float | None, frames: int | None, period: float) -> int | None:
    """Number of frames after which a stream ends; None: no limit."""
    limits = [frames, None if duration is None else max(round(duration / period), 1)]
    return min((limit for limit in limits if limit is not None), default=None)
