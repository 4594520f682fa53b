"""`radarsim emulate` in a process: with a foreign client, with `radarize capture`, and with wrong arguments."""

import os
import subprocess
import sys

import numpy as np
import pytest

from radarize.io.console import run
from radarize.io.recording import Recording
from radarize.radar.presets import PRESETS
from radarsim.cli import app
from tests.emulator.client import SMALL
from tests.virtual import BOARD, COMPUTER, CONFIG, emulator, record


def test_xwr_captures_what_was_recorded(tmp_path):
    """The client `xwr` (PyPI) configures the emulator of the command line, captures, and gets the recorded samples."""
    from xwr import DCAConfig, XWRConfig, XWRSystem

    adc = record(tmp_path / "r.h5", CONFIG, 25)
    with emulator(tmp_path / "r.h5", tmp_path) as running:
        radar = XWRConfig(
            device="AWR1843", frequency=77.0, idle_time=30.0, adc_start_time=5.0, ramp_end_time=60.0, tx_start_time=1.0,
            freq_slope=60.0, adc_samples=128, sample_rate=5000, frame_length=32, frame_period=40.0,
            port=str(running.port),
        )  # fmt: skip
        capture = DCAConfig(
            sys_ip=COMPUTER, fpga_ip=BOARD, config_port=running.command_port, data_port=running.data_port, delay=25.0
        )
        system = XWRSystem(radar=radar, capture=capture, strict=True)
        frames = list(system.stream())
        system.stop()
    assert "25 frames sent" in running.output
    # The end of the 25th frame comes 2 s late, after xwr has given up.
    assert len(frames) == 24 and all(frame.complete for frame in frames)
    received = np.stack([np.frombuffer(frame.data, "<i2") for frame in frames]).reshape(24, *radar.raw_shape)
    q0, q1, i0, i1 = (received[..., n::4] for n in range(4))
    samples = np.stack([np.stack([i0, i1], -1), np.stack([q0, q1], -1)], -1).reshape(24, *CONFIG.frame_shape)
    assert np.array_equal(samples, adc[:24])


def test_our_own_capture_loses_nothing(tmp_path):
    """The preset `radarize` at 30 frames/s for two seconds, with both command lines in separate processes."""
    preset = PRESETS["radarize"]
    adc = record(tmp_path / "r.h5", preset, 30)
    with emulator(tmp_path / "r.h5", tmp_path, "--loop") as running:
        captured = subprocess.run(
            [
                sys.executable, "-m", "radarize.cli", "capture", "--config", "radarize", *running.options,
                "--frames", "60", "-o", tmp_path / "out.h5",
            ],
            capture_output=True, text=True, timeout=300,
        )  # fmt: skip
    assert captured.returncode == 0, captured.stderr
    with Recording(tmp_path / "out.h5") as recording:
        assert recording.config == preset and recording.valid(0, 60).all()  # no packet lost
        numbers = np.round(recording.times / preset.frame_period).astype(int)
        for first in range(0, len(recording), 30):
            assert np.array_equal(recording.adc(first, first + 30), adc[numbers[first : first + 30] % 30])
        dropped = recording.attributes["warnings"]
        if dropped and os.getloadavg()[0] > 2 * len(os.sched_getaffinity(0)):
            pytest.skip(f"this machine is too busy to write 30 frames/s: {dropped}")
        assert len(recording) == 60 and dropped == ""


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["nowhere.h5"], "nowhere.h5: no such file"),
        (["nowhere"], "no scene 'nowhere'"),
        (["REC", "--board", "203.0.113.5"], "203.0.113.5:4096 cannot be the board's address"),
        (["REC", "--loss", "2"], "loss"),
    ],
)
def test_the_command_line_reports_what_is_wrong(tmp_path, capsys, arguments, message):
    record(tmp_path / "r.h5", SMALL, 1)
    arguments = [str(tmp_path / "r.h5") if argument == "REC" else argument for argument in arguments]
    with pytest.raises(SystemExit) as exit_:
        run(app, "radarsim", ["emulate", *arguments])
    printed = capsys.readouterr().err
    assert exit_.value.code == 2 and message in printed and printed.count("\n") == 1, printed
