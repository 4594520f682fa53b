"""Radar's command line, against the virtual one, and against unsuitable ports."""

import contextlib
import os
import threading
from collections.abc import Callable, Iterator

import pytest
import serial

from radarize.capture.uart import PROMPT, Uart, commands, text_for
from radarize.io.errors import InputError
from radarize.radar.cfg import write_cfg
from radarize.radar.presets import PRESETS
from radarsim.emulator.commandline import CommandLine
from radarsim.emulator.uart import Uart as Terminal

CONFIG = PRESETS["radarize"]


class Radar:
    """Radar controlled by the virtual command line."""

    def __init__(self):
        self.started = []

    def start(self, config, frames):
        self.started.append(config)

    def stop(self):
        pass


@pytest.fixture
def terminal():
    radar = Radar()
    port = Terminal(lambda: CommandLine(radar).execute)
    yield port, radar
    port.close()


@contextlib.contextmanager
def answering(answer: Callable[[bytes], bytes]) -> Iterator[str]:
    """Port behind which `answer` replies to every line."""
    master, slave = os.openpty()
    closed = threading.Event()
    os.set_blocking(master, False)

    def serve() -> None:
        line = b""
        while not closed.wait(0.005):
            with contextlib.suppress(OSError):
                line += os.read(master, 4096)
            if line.endswith(b"\n"):
                os.write(master, answer(line.strip()))
                line = b""

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield os.ttyname(slave)
    finally:
        closed.set()
        thread.join()
        os.close(master)
        os.close(slave)


def test_configures_and_starts(terminal):
    port, radar = terminal
    with Uart(port.path) as uart:
        for _ in range(2):  # a radar that runs is stopped and configured anew
            uart.configure(write_cfg(CONFIG))
            uart.start()
        uart.stop()
    assert radar.started == [CONFIG, CONFIG]


def test_the_radars_own_words_are_shown(terminal):
    port, radar = terminal
    with Uart(port.path) as uart:
        uart.send("sensorStop")
        with pytest.raises(InputError, match="refuses 'profileCfg 0': Error: .*profileCfg|Invalid usage"):
            uart.send("profileCfg 0")
        with pytest.raises(InputError, match="refuses 'profilCfg 0': 'profilCfg' is not recognized"):
            uart.send("profilCfg 0")
        with pytest.raises(InputError, match="refuses 'sensorStart': Error: Full configuration must be provided"):
            uart.start()
    assert not radar.started


def test_a_wrong_baud_rate(terminal):
    with Uart(terminal[0].path, 921600) as uart, pytest.raises(InputError, match="--baud 921600 is wrong"):
        uart.send("sensorStop", patience=0.5)


def test_a_port_that_is_none(tmp_path):
    with pytest.raises(InputError, match="/dev/ttyNONE: no such serial port .present: "):
        Uart("/dev/ttyNONE")
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=f"--port {tmp_path}/file: "):
        Uart(str(tmp_path / "file"))


def test_a_busy_port(terminal):
    with serial.Serial(terminal[0].path, exclusive=True), pytest.raises(InputError, match="busy; another program"):
        Uart(terminal[0].path)


def test_silence_is_explained():
    with answering(lambda line: b"") as port, Uart(port) as uart:
        with pytest.raises(InputError, match="no answer to 'sensorStop' within 0.3 s.*powered.*SOP"):
            uart.send("sensorStop", patience=0.3)


def test_calibration_data_may_be_unknown():
    """Old firmware rejects calibData as unknown; everything else must be accepted."""

    def old(line: bytes) -> bytes:
        known = b"Done" if not line.startswith(b"calibData") else b"'calibData' is not recognized as a CLI command"
        return line + b"\n\r" + known + b"\n\r" + PROMPT.encode()

    with answering(old) as port, Uart(port) as uart:
        uart.configure(write_cfg(CONFIG))
        assert uart.ignored == ["calibData 0 0 0"]


def test_answers_in_pieces_and_debug_output():
    def chatty(line: bytes) -> bytes:
        return line + b"\n\rDebug: Init Calibration Status = 0x7ffe\n\rDone\n\r\n\r" + PROMPT.encode()

    with answering(chatty) as port, Uart(port) as uart:
        assert uart.send("sensorStart") == "Debug: Init Calibration Status = 0x7ffe"


def test_order_of_commands():
    lines = commands(
        "% about\nsensorStop\nchannelCfg 15 7 0 % all\n\nflushCfg\nsensorStart\n  frameCfg  0 2 32 0 33 1 0\n"
    )
    assert lines == ["sensorStop", "flushCfg", "channelCfg 15 7 0", "frameCfg 0 2 32 0 33 1 0"]


def test_a_configuration_that_streams_nothing():
    text = write_cfg(CONFIG)
    assert text_for(CONFIG, text, "a.cfg") == text
    assert text_for(CONFIG, '{"mmWaveDevices": []}', "a.mmwave.json") == text
    for other, found in (("lvdsStreamCfg -1 0 0 0", "lvdsStreamCfg -1 0 0 0"), ("", "no lvdsStreamCfg")):
        with pytest.raises(InputError, match=f"a.cfg: has {found}, expected lvdsStreamCfg -1 0 1 0"):
            text_for(CONFIG, text.replace("lvdsStreamCfg -1 0 1 0", other), "a.cfg")
