"""Firmware command line: accepted and refused commands, and their messages."""

import re

import pytest

from radarize.io.errors import InputError
from radarize.radar.cfg import write_cfg
from radarize.radar.config import RadarConfig
from radarize.radar.presets import PRESETS, load_config
from radarsim.emulator.commandline import CommandLine

LINES = [line for line in write_cfg(PRESETS["radarize"]).splitlines() if line != "sensorStart"]
FULL = "Error: Full configuration must be provided before sensor can be started the first time\nError -1\n"


class FakeRadar:
    def __init__(self, refuse: str = ""):
        self.started: list[tuple[RadarConfig, int]] = []
        self.stops, self.refuse = 0, refuse

    def start(self, config: RadarConfig, frames: int) -> None:
        if self.refuse:
            raise InputError(self.refuse)
        self.started.append((config, frames))

    def stop(self) -> None:
        self.stops += 1


def configured(radar: FakeRadar, **replaced: str) -> CommandLine:
    """Command line that has received the preset's commands, some of them replaced."""
    line = CommandLine(radar)
    for command in LINES:
        answer = line.execute(replaced.get(command.split()[0], command))
        assert answer in ("Done\n", "Skipped\n", "Ignored: Sensor is already stopped\nDone\n")
    return line


def test_the_configuration_arrives():
    radar = FakeRadar()
    line = configured(radar, frameCfg="frameCfg 0 2 32 7 33.333 1 0")
    assert line.execute("sensorStart") == "Debug: Init Calibration Status = 0x1ffe\nDone\n"
    assert radar.started == [(PRESETS["radarize"], 7)]
    assert line.execute("sensorStart") == "Ignored: Sensor is already started\nDone\n"
    assert line.execute("profileCfg 0 77 1 1 1 0 0 1 1 8 1 0 0 30").startswith("Ignored: This command is not allowed")
    assert line.execute("sensorStop") == "Done\n"
    assert line.execute("sensorStop") == "Ignored: Sensor is already stopped\nDone\n"
    assert radar.stops == 1 and len(radar.started) == 1


def test_real_configuration_files_are_taken(recordings):
    files = [*recordings.glob("configs/*.cfg"), *recordings.glob("iwr1843-pcap/*.cfg")]
    assert len(files) == 4
    for path in files:
        config, text = load_config(path)
        radar = FakeRadar()
        line = CommandLine(radar)
        answers = [line.execute(command) for command in text.splitlines()]
        assert all(answer.endswith(("Done\n", "Skipped\n")) for answer in answers), path
        assert radar.started == [(config, 0)]


@pytest.mark.parametrize(
    "command, answer",
    [
        ("", ""),
        ("   ", ""),
        ("% a comment", "Skipped\n"),
        ("sensorstart", "'sensorstart' is not recognized as a CLI command\n"),
        ("\x80\xff", "'\x80\xff' is not recognized as a CLI command\n"),
        ("channelCfg 15 7", "Error: Invalid usage of the CLI command\nError -1\n"),
        ("adcbufCfg -1 0 1 1 1 1", "Error: Invalid usage of the CLI command\nError -1\n"),
        ("compRangeBiasAndRxChanPhase 0" + " 1 0" * 8, "Error: Invalid usage of the CLI command\nError -1\n"),
        ("dfeDataOutputMode 4", "Error: Invalid mode.\nError -1\n"),
        ("sensorStart", FULL),
        ("sensorStart 0", FULL),
        ("sensorStop", "Ignored: Sensor is already stopped\nDone\n"),
        ("flushCfg", "Done\n"),
    ],
)
def test_answers_after_power_up(command, answer):
    assert CommandLine(FakeRadar()).execute(command) == answer


def test_chirps_want_the_output_mode_first():
    answer = CommandLine(FakeRadar()).execute("chirpCfg 0 0 0 0 0 0 0 1")
    assert answer == "Error: Configuration is valid only if the DFE Output Mode is Chirp\nError -1\n"


def test_every_demo_command_must_have_come():
    for left_out in ("guiMonitor", "lvdsStreamCfg", "calibData", "adcbufCfg"):
        radar = FakeRadar()
        line = configured(radar, **{left_out: "% nothing"})
        assert line.execute("sensorStart") == FULL and not radar.started
        line.execute(next(command for command in LINES if command.startswith(left_out)))
        assert line.execute("sensorStart").endswith("Done\n") and radar.started


def test_restarts():
    radar = FakeRadar()
    line = configured(radar)
    line.execute("sensorStart")
    line.execute("sensorStop")
    assert "You have provided no configuration" in line.execute("sensorStart")
    assert line.execute("sensorStart 0") == "Done\n"
    line.execute("sensorStop")
    line.execute("guiMonitor -1 0 0 0 0 0 0")
    assert "You have provided partial configuration" in line.execute("sensorStart")
    assert "You have provided partial configuration" in line.execute("sensorStart 0")
    for command in LINES:
        line.execute(command)
    assert "You have provided complete new configuration" in line.execute("sensorStart 0")
    assert "Reconfig is not supported" in line.execute("sensorStart 1")
    assert line.execute("sensorStart") == "Done\n"
    assert [config for config, _ in radar.started] == [PRESETS["radarize"]] * 3


def test_antennas_cannot_change_without_a_reboot():
    radar = FakeRadar()
    line = configured(radar)
    line.execute("sensorStart")
    line.execute("sensorStop")
    for command in LINES:
        line.execute(command.replace("channelCfg 15 7 0", "channelCfg 3 7 0"))
    assert re.search("channelCfg.*differ.*reboot", line.execute("sensorStart"))
    assert len(radar.started) == 1


@pytest.mark.parametrize(
    "command, message",
    [
        ("profileCfg 0 77 122 7 50 0 0 120 1 96 2285 0 0 30", "sweep"),
        ("profileCfg 0 77 122 7 50 0 0 80 1 96 500 0 0 30", "ADC window"),
        ("profileCfg 0 77 1 7 50 0 0 80 1 96 2285 0 0 30", "idle_time is 1 us, expected at least 7 us"),
        ("frameCfg 0 2 32 0 16.7 1 0", "frame_period is 16.7 ms"),
        ("frameCfg 0 3 32 0 33.333 1 0", "chirp 3 has none"),
        ("lvdsStreamCfg -1 0 0 0", "nothing would go to the DCA1000"),
        ("frameCfg 0 2 32 many 33.333 1 0", "numFrames is many, expected 0 (without end) to 65535"),
    ],
)
def test_limits_are_named(command, message):
    radar = FakeRadar()
    answer = configured(radar, **{command.split()[0]: command}).execute("sensorStart")
    assert "Error: mmWave Config failed: " in answer and answer.endswith("Error -1\n") and message in answer
    assert not radar.started


def test_a_source_that_refuses_is_heard_and_asked_again():
    radar = FakeRadar("samples is 96, expected 128")
    line = configured(radar)
    assert "Error: mmWave Config failed: samples is 96, expected 128\nError -1\n" in line.execute("sensorStart")
    radar.refuse = ""
    assert line.execute("sensorStart") == "Done\n"
