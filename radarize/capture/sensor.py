"""A real sensor: a radar on its serial port, a DCA1000 on the network, and the order in which to tell them things."""

import contextlib
import socket
import time
from collections.abc import Callable

from radarize.capture.board import CaptureCard, NetworkAddresses
from radarize.capture.receiver import buffer_warning, enlarge, receive
from radarize.capture.stream import FrameStream
from radarize.capture.uart import BAUD, Uart, text_for
from radarize.io.errors import InputError
from radarize.io.recording.captured import FROM_RADAR
from radarize.radar.cfg import remarks
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000_commands import Status
from radarize.radar.limits import check_limits

#: s: the board holds the end of the last frame back for 2 s, in the hope of filling a packet.
_LAST_PACKET = 3.0


class Sensor(FrameStream):
    """A radar that streams from entering the context on, and is stopped on leaving it.

    Args:
        text: it was read from.
        name: what errors call it.
        port: the radar's serial command port.
        baud: of its firmware.
        network: addresses and ports of the DCA1000.
        slots: frames that may wait.

    Attributes:
        port: the radar's.
        text: what the radar is sent.
        version: of the board's firmware, once entered.

    Raises:
        InputError: the radar cannot do the configuration, or streams no samples with it; ports cannot be opened. On
            entering: what radar or board refuse.
    """

    def __init__(
        self,
        config: RadarConfig,
        text: str,
        name: str,
        port: str,
        *,
        baud: int = BAUD,
        network: NetworkAddresses,
        slots: int = 64,
    ):
        check_limits(config, demo=True)
        self.text, self.version = text_for(config, text, name), ""
        self._running = False
        self.port = port
        with contextlib.ExitStack() as stack:
            self._uart = stack.enter_context(Uart(port, baud))
            self._board = stack.enter_context(CaptureCard(network))
            self._receiver = stack.enter_context(network.bind(network.data_port))
            self._open = stack.pop_all()
        self._notes = [*remarks(text, config), *buffer_warning(enlarge(self._receiver), config)]
        super().__init__(config, receive, self._receiver, network.dca, config, slots=slots)

    def __enter__(self) -> "Sensor":
        try:
            self._uart.configure(self.text)  # stops a radar that still runs
            self.version = self._board.configure(self.config)
            _drain(self._receiver)
            super().__enter__()
            self._board.start()
            self._running = True
            self._uart.start()  # only now: whatever comes before the board records is lost
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._halt(self._uart.stop, self._board.stop)
        super().__exit__()
        self._open.close()

    def stop(self) -> None:
        """Stop the radar at the end of a frame, and wait until the board has sent all of it."""
        self._halt(self._uart.stop, self._rest, self._board.stop)
        super().stop()

    def _halt(self, *steps: Callable[[], object]) -> None:
        if not self._running:
            return
        self._running = False
        for step in steps:
            try:
                step()
            except InputError as error:  # unplugged, perhaps; what was received is to be kept all the same
                self._notes.append(str(error))

    def _rest(self) -> None:
        deadline = time.monotonic() + _LAST_PACKET
        while not self._board.status(0.1) & Status.RECORD_COMPLETED and time.monotonic() < deadline:
            pass

    @property
    def facts(self) -> dict[str, object]:
        """What a recording should say about its origin."""
        return {"source": f"{FROM_RADAR}{self.port}, DCA1000 at {self._board.network.dca}"}

    def silent(self, seconds: float, at_all: bool) -> None:
        """Why nothing comes.

        Raises:
            InputError: nothing ever came.
        """
        network, foreign = self._board.network, self.counts.foreign
        where = f"at {network.host}, UDP port {network.data_port}"
        if troubles := self._board.troubles():
            why = troubles[0]
        elif not at_all:
            why = "the radar has stopped, or a cable is out"
        elif foreign:
            why = f"{foreign} packets came from elsewhere, expected --dca {network.dca} to be their sender"
        elif self.packets.received:
            why = f"{self.packets.received} packets came, but no whole frame of {self.config.frame_bytes} bytes"
        else:
            why = "no packet came; is a firewall in between, or another --host set in the board?"
        message = f"no frame {where} for {seconds:.1f} s: {why}"
        if at_all:
            raise InputError(message)
        self._notes.append(message)

    def troubles(self) -> list[str]:
        """What the user should know about radar, board and stream so far."""
        ignored = [f"the radar does not know {command!r}, which is not needed" for command in self._uart.ignored]
        return [*self._notes, *ignored, *self._board.troubles(), *super().troubles()]


def _drain(receiver: socket.socket) -> None:
    """Throw away what an earlier capture left in the socket."""
    receiver.setblocking(False)
    with contextlib.suppress(OSError):
        while True:
            receiver.recv(1)
