"""Serial port of the virtual radar."""

import os
import time

import pytest

from radarize.io.errors import InputError
from radarize.radar.dca1000_commands import Opcode, Reply
from radarsim.emulator.commandline import PROMPT
from tests.emulator.client import SMALL, attached
from tests.virtual import record


def test_echo_answer_and_prompt(playing):
    client, _, _ = playing
    assert client.command("sensorStop") == "sensorStop\nIgnored: Sensor is already stopped\n\rDone\n\r" + PROMPT
    assert client.command("nonsense 1 2") == "nonsense 1 2\n'nonsense' is not recognized as a CLI command\n\r" + PROMPT
    assert client.command("") == "\n" + PROMPT
    # After "\r\n", as from a terminal program, the firmware prompts twice.
    assert client.command("% hello", "\r\n") == "% hello\r\nSkipped\n\r" + PROMPT
    assert client.serial.read_until(PROMPT.encode()) == b"\n" + PROMPT.encode()


def test_characters_take_their_time(playing):
    client, _, _ = playing
    start = time.monotonic()
    answer = client.command("x" * 200)
    assert time.monotonic() - start > len(answer) * 10 / 115200


def test_the_wrong_baud_rate_gives_garbage(playing):
    client, _, _ = playing
    client.serial.baudrate = 921600
    client.serial.timeout = 0.3
    client.serial.write(b"sensorStop\n")
    answer = client.serial.read(1000)
    assert len(answer) == 11 and not any(32 <= byte < 127 for byte in answer)
    client.serial.baudrate = 115200
    assert client.command("version").endswith("Done\n\r" + PROMPT)


def test_the_board_resets_the_radar(playing):
    client, _, lines = playing
    client.configure(SMALL)
    assert client.ask(Opcode.RESET_RADAR) == Reply(Opcode.RESET_RADAR, 0)
    client.serial.write(b"sensorStop\n")  # into the void: the radar is booting
    banner = client.serial.read_until(PROMPT.encode()).decode()
    assert "xWR18xx MMW Demo" in banner and "sensorStop" not in banner
    assert "Full configuration must be provided" in client.command("sensorStart 0")
    assert "board: radar reset" in lines


def test_a_link_names_the_port_and_goes_away(tmp_path):
    record(tmp_path / "small.h5", SMALL, 1)
    link = tmp_path / "tty"
    for _ in range(2):
        with attached(tmp_path / "small.h5", port_link=link) as (emulator, client, _):
            assert os.readlink(link) == emulator.port
            assert client.command("flushCfg").startswith("flushCfg\nDone")
        assert not link.is_symlink()
    link.write_text("something of the user's")
    with (
        pytest.raises(InputError, match="cannot become a link"),
        attached(tmp_path / "small.h5", port_link=link),
    ):
        pass
    assert link.read_text() == "something of the user's"
