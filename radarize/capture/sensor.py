"""Real sensor: a radar on its serial port and a DCA1000 on the network, controlled in the correct order."""

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

#: s: the board holds the end of the last frame back for 2 s to fill a packet.
_LAST_PACKET = 3.0


class Sensor(FrameStream):
    """Radar that streams from entering the context until leaving it.

    Args:
        text: text that the configuration was read from.
        name: name in error messages.
        port: serial command port of the radar.
        baud: baud rate of its firmware.
        network: addresses and ports of the DCA1000.
        slots: number of frames that may wait.

    Attributes:
        port: port of the radar.
        text: commands sent to the radar.
        version: firmware version of the board, once entered.

    Raises:
        InputError: the chip cannot use the configuration, or it does not stream samples; ports cannot be opened. On
            entering: an error of radar or board.
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
            self._uart.configure(self.text)  # stops a running radar
            self.version = self._board.configure(self.config)
            _drain(self._receiver)
            super().__enter__()
            self._board.start()
            self._running = True
            self._uart.start()  # last, because samples before the board records are lost
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._halt(self._uart.stop, self._board.stop)
        super().__exit__()
        self._open.close()

    def stop(self) -> None:
        """Stop the radar at the end of a frame, and wait until the board has sent everything."""
        self._halt(self._uart.stop, self._rest, self._board.stop)
        super().stop()

    def _halt(self, *steps: Callable[[], object]) -> None:
        if not self._running:
            return
        self._running = False
        for step in steps:
            try:
                step()
            except InputError as error:  # perhaps unplugged; received frames must be kept
                self._notes.append(str(error))

    def _rest(self) -> None:
        deadline = time.monotonic() + _LAST_PACKET
        while not self._board.status(0.1) & Status.RECORD_COMPLETED and time.monotonic() < deadline:
            pass

    @property
    def facts(self) -> dict[str, object]:
        """Attributes on the origin, for a recording."""
        return {"source": f"{FROM_RADAR}{self.port}, DCA1000 at {self._board.network.dca}"}

    def silent(self, seconds: float, at_all: bool) -> None:
        """Warn about the reason that no frames arrive.

        Raises:
            InputError: no frame has ever arrived.
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
        """Warnings on radar, board and stream so far."""
        ignored = [f"the radar does not know {command!r}, which is not needed" for command in self._uart.ignored]
        return [*self._notes, *ignored, *self._board.troubles(), *super().troubles()]


def _drain(receiver: socket.socket) -> None:
    """Discard packets of an earlier capture in the socket."""
    receiver.setblocking(False)
    with contextlib.suppress(OSError):
        while True:
            receiver.recv(1)
