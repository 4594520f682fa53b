"""From serial port and UDP to a recording, with the virtual sensor: the recording equals the transmitted samples."""

import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from radarize.capture import stream
from radarize.capture.receiver import buffer_warning
from radarize.capture.record import record
from radarize.capture.sensor import Sensor
from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.radar.assembler import FrameAssembler
from radarize.radar.cfg import parse_cfg, write_cfg
from radarize.radar.dca1000 import MAX_PAYLOAD, decode, encode
from radarize.radar.presets import PRESETS
from radarsim.emulator.disturbance import Disturbance
from tests import virtual
from tests.packets import packets
from tests.virtual import COMPUTER, SMALL, emulated, network, sensor

FRAMES = 100


@pytest.fixture
def impatient(monkeypatch):
    """Streams end early, but after the board's last packet, which is 2 s late."""
    monkeypatch.setattr(stream, "SILENCE", 2.5)


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    path = tmp_path_factory.mktemp("played") / "noise.h5"
    return path, virtual.record(path, SMALL, FRAMES)


def test_every_sample_arrives(played, tmp_path):
    """Twice with one sensor: a stopped radar starts again."""
    source, sent = played
    with emulated(source) as (emulator, where):
        for name in ("first.h5", "second.h5"):
            with sensor(emulator, where) as radar:
                record(radar, tmp_path / name, threading.Event(), frames=40)
                assert radar.version == "2.8" and radar.troubles() == []
            with Recording(tmp_path / name) as recording:
                assert np.array_equal(recording.adc(0, 99), sent[:40])
                assert recording.valid(0, 99).all() and recording.attributes["warnings"] == ""
                assert recording.times == pytest.approx(np.arange(40) * SMALL.frame_period)
                assert parse_cfg(recording.file["radar"].attrs["cfg"]) == SMALL
                assert abs(recording.attributes["first_packet_time"] - time.time()) < 600


def test_the_end_of_the_stream_ends_the_recording_with_its_late_last_packet(played, tmp_path, impatient):
    source, sent = played
    with emulated(source) as (emulator, where), sensor(emulator, where) as radar:
        record(radar, tmp_path / "all.h5", threading.Event())
        assert "no frame at 127.0.0.1" in radar.troubles()[0]
    with Recording(tmp_path / "all.h5") as recording:
        assert np.array_equal(recording.adc(0, FRAMES), sent)


def test_lost_late_repeated_and_reordered_packets_over_the_network(played, tmp_path):
    source, sent = played
    disturbance = Disturbance(0.03, 0.03, 0.03, rng=np.random.default_rng(4))
    with emulated(source, disturbance=disturbance) as (emulator, where), sensor(emulator, where) as radar:
        record(radar, tmp_path / "lossy.h5", threading.Event(), frames=90)
        counts = radar.packets
    assert disturbance.lost and disturbance.duplicated and disturbance.reordered
    assert counts.duplicates + counts.late >= 1
    with Recording(tmp_path / "lossy.h5") as recording:
        if len(recording) < 90:
            pytest.skip("this machine was too busy to take in 90 frames in real time")
        adc, valid = recording.adc(0, 90), recording.valid(0, 90)
        assert f"{np.size(valid) - valid.sum()} of {valid.size} chirps" in recording.attributes["warnings"]
    assert 0 < (~valid).sum() < 0.2 * valid.size
    assert np.array_equal(adc[valid], sent[:90][valid])
    assert ((adc == sent[:90]) | (adc == 0)).all()


def test_each_of_ten_thousand_packets_lands_in_its_place():
    """1 % lost, 1 % duplicated, 1 % reordered: exactly the chirps of lost packets are marked, and only their bytes are
    zero."""
    config = PRESETS["radarize"]
    sent = np.random.default_rng(0).integers(1, 2**15, (102, *config.frame_shape), dtype=np.int16)
    sequence = encode(sent, config).tobytes()
    disturbance = Disturbance(0.01, 0.01, 0.01, rng=np.random.default_rng(1))
    through: list[bytes] = []
    for packet in packets(sequence):
        through += disturbance(packet.encode())
    through += disturbance.rest()
    kept = {int.from_bytes(data[4:10], "little") for data in through}
    assembler, frames = FrameAssembler(config), []
    for data in through:
        frames += assembler.take(data)
    frames += assembler.finish()
    assert len(range(0, len(sequence), MAX_PAYLOAD)) > 10_000 and disturbance.lost > 80

    arrived = np.zeros(len(sequence), bool)
    for offset in kept:
        arrived[offset : offset + MAX_PAYLOAD] = True
    expected = np.frombuffer(sequence, np.uint8) * arrived
    assert b"".join(words.tobytes() for words, _ in frames) == expected.tobytes()
    fired = arrived.reshape(len(sent), config.loops, 3, -1).all(axis=3)[:, :, list(config.slot)]
    assert np.array_equal(np.stack([valid for _, valid in frames]), fired)
    adc = np.concatenate([decode(words, config) for words, _ in frames])
    assert np.array_equal(adc[fired], sent[fired])
    assert assembler.counts.lost_bytes == (~arrived).sum()


def test_interrupting_the_command_leaves_a_whole_file(played, tmp_path):
    source, sent = played
    (tmp_path / "small.cfg").write_text(write_cfg(SMALL))
    with emulated(source) as (emulator, where):
        command = [sys.executable, "-m", "radarize.cli", "capture", "--config", "small.cfg", "-o", "cut.h5"]
        command += ["--port", emulator.port, "--host", where.host, "--dca", where.dca]
        command += ["--command-port", str(where.command_port), "--data-port", str(where.data_port)]
        process = subprocess.Popen(
            command, cwd=tmp_path, stdout=subprocess.PIPE, text=True,
            env={"PYTHONPATH": str(Path(__file__).parents[2]), "PATH": "/usr/bin:/bin"},
        )  # fmt: skip
        deadline = time.monotonic() + 120
        while emulator.frames < 30 and time.monotonic() < deadline:
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=60)
        assert process.returncode == 0
    with Recording(tmp_path / "cut.h5") as recording:
        assert out.split() == ["cut.h5:", str(len(recording)), "frames"]
        assert 25 <= len(recording) == emulator.frames
        assert np.array_equal(recording.adc(0, FRAMES), sent[: len(recording)])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cut.h5", "small.cfg"]


def test_nothing_comes(played, tmp_path, impatient):
    """A board that answers, but sends its samples to another address."""
    source, _ = played
    elsewhere = network()
    with emulated(source) as (emulator, where):
        wrong = type(where)(where.host, where.dca, where.command_port, elsewhere.data_port)
        with sensor(emulator, wrong) as radar:
            with pytest.raises(
                InputError, match=f"UDP port {elsewhere.data_port} for .* s: no packet came; .*firewall"
            ):
                record(radar, tmp_path / "none.h5", threading.Event())
        assert not list(tmp_path.iterdir())


def test_settings_that_no_radar_takes():
    config = SMALL.model_copy(update={"frame_period": 2.0})
    with pytest.raises(InputError, match="frame_period is 2000 ms"):
        Sensor(config, write_cfg(config), "a.cfg", "/dev/null", network=network())


def test_small_buffers_give_a_warning():
    assert buffer_warning(64 << 20, PRESETS["radarize"]) == []
    (words,) = buffer_warning(208 << 10, PRESETS["radarize"])
    assert "holds 208 KiB, a quarter of a second needs 1080" in words and "sysctl net.core.rmem_max" in words


def test_a_stranger_who_never_stops_does_not_keep_a_capture_from_ending(played, tmp_path):
    """Foreign packets, always within the timeout of the board's last ones."""
    path, adc = played
    ended = threading.Event()

    def pester(port: int) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            while not ended.wait(0.02) and time.monotonic() < start + 20:
                stranger.sendto(bytes(100), (COMPUTER, port))

    with emulated(path) as (board, where), sensor(board, where) as stream:
        guest = threading.Thread(target=pester, args=(where.data_port,))
        start = time.monotonic()
        guest.start()
        try:
            record(stream, tmp_path / "captured.h5", threading.Event(), frames=10)
        finally:
            ended.set()
            guest.join()
    assert time.monotonic() - start < 12 and stream.counts.foreign > 10
    with Recording(tmp_path / "captured.h5") as recording:
        assert np.array_equal(recording.adc(0, 10), adc[:10])
