"""Frames made ahead of time in a separate process, so that computing them does not disturb the packets' timing."""

import queue
import signal
import threading
from multiprocessing import get_context
from multiprocessing.connection import Connection

from radarize.io.errors import InputError
from radarize.radar.config import RadarConfig
from radarsim.emulator.source import Source


class Feed:
    """Buffered frames of a source for one configuration, from the first one on.

    Args:
        source: source of the frames.
        config: configuration to make them for.
        ahead: number of frames to buffer.

    Attributes:
        failure: error of the source, if it failed.
    """

    def __init__(self, source: Source, config: RadarConfig, ahead: int):
        self.config = config
        self.failure: InputError | None = None
        context = get_context("spawn")
        receiver, sender = context.Pipe(duplex=False)
        self._process = context.Process(target=_produce, args=(source, config, sender), daemon=True)
        self._process.start()
        sender.close()  # so that the receiver notices the process's death
        self._frames: queue.Queue[bytes | None | InputError] = queue.Queue(max(ahead, 1))
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._fetch, args=(receiver,), name="feed", daemon=True)
        self._thread.start()

    def next(self, timeout: float) -> bytes | None:
        """Return the next frame; None after the last one.

        Raises:
            TimeoutError: no frame is ready in time.
            InputError: the source failed.
        """
        try:
            item = self._frames.get(timeout=timeout)
        except queue.Empty:
            raise TimeoutError from None
        if not isinstance(item, bytes):
            self._frames.put(item)  # later calls get the end as well
        if isinstance(item, InputError):
            raise item
        return item

    @property
    def waiting(self) -> int:
        """Number of frames that are ready."""
        return self._frames.qsize()

    def close(self) -> None:
        """End the process that makes frames."""
        self._closed.set()
        self._process.terminate()
        self._process.join()
        self._thread.join()

    def _fetch(self, receiver: Connection) -> None:
        with receiver:
            item: bytes | None | InputError = b""
            while isinstance(item, bytes) and not self._closed.is_set():
                try:
                    item = receiver.recv()
                except (EOFError, OSError):  # perhaps in the middle of a frame
                    item = InputError("the process that makes frames has died")
                if isinstance(item, InputError) and not self._closed.is_set():
                    self.failure = item
                while not self._closed.is_set():
                    try:
                        self._frames.put(item, timeout=0.1)
                        break
                    except queue.Full:
                        pass


def _produce(source: Source, config: RadarConfig, sender: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the emulator ends this process itself
    try:
        for frame in source.frames(config):
            sender.send(frame)
        sender.send(None)
    except InputError as error:
        sender.send(error)
    except BrokenPipeError:
        pass  # the emulator is gone
