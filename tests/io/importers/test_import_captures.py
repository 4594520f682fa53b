"""Network captures with several captures of a radar, and with incomplete packets."""

import socket
import struct

import numpy as np
import pytest
from typer.testing import CliRunner

import radarize as rz
from radarize.cli import app
from radarize.io.errors import InputError
from radarize.io.importers import Given, import_recording
from radarize.io.recording import Recording
from radarize.radar.cfg import write_cfg
from radarize.radar.dca1000 import encode
from tests.io.importers.test_import_pcap import CONFIG, pcap
from tests.packets import packets

WALKS = np.random.default_rng(3).integers(-999, 999, (2, 12, *CONFIG.frame_shape), dtype=np.int16)


def sent(frames, source="192.168.33.180", port=4098, from_port=4096) -> list[bytes]:
    """Ethernet frames of a board's packets."""
    return [frame(packet.encode(), source, port, from_port) for packet in packets(encode(frames, CONFIG).tobytes())]


def frame(payload, source="192.168.33.180", port=4098, from_port=4096, flags=0):
    addresses = socket.inet_aton(source) + socket.inet_aton("192.168.33.30")
    ip = struct.pack(">BBHHHBBH", 0x45, 0, 28 + len(payload), 0, flags, 64, 17, 0) + addresses
    return bytes(12) + b"\x08\x00" + ip + struct.pack(">HHHH", from_port, port, 8 + len(payload), 0) + payload


def in_turns(one, other):
    return [packet for pair in zip(one, other, strict=True) for packet in pair]


CASES = {
    "two starts": sent(WALKS[0]) + sent(WALKS[1]),
    "a short start": sent(WALKS[0][:1]) + sent(WALKS[1]),
    "two boards": in_turns(sent(WALKS[0]), sent(WALKS[1], "192.168.33.181")),
    "two ports": in_turns(sent(WALKS[0]), sent(WALKS[1], port=4099)),
    "two ports of a board": in_turns(sent(WALKS[0]), sent(WALKS[1], from_port=4097)),
}


@pytest.mark.parametrize("case", CASES)
def test_each_capture_becomes_a_recording(tmp_path, case):
    source, walks = pcap(tmp_path / "a.pcap", CASES[case]), list(WALKS)
    if case == "a short start":
        walks[0] = walks[0][:1]
    import_recording(source, tmp_path / "b.h5", Given(CONFIG))
    for name, walk, number in (("b.h5", walks[0], 1), ("b-2.h5", walks[1], 2)):
        with Recording(tmp_path / name) as recording:
            assert np.array_equal(recording.adc(0, 99), walk) and recording.valid(0, 99).all()
            warnings = recording.attributes["warnings"]
            assert "holds 2 captures" in warnings and f"this is capture {number}" in warnings
            assert f"capture 1 is in {tmp_path}/b.h5; capture 2 is in {tmp_path}/b-2.h5" in warnings
    with pytest.raises(InputError, match="b-2.h5: already exists, and capture 2 of 2"):
        import_recording(source, tmp_path / "b.h5", Given(CONFIG))
    for number, walk in enumerate(walks, 1):
        import_recording(source, tmp_path / "c.h5", Given(CONFIG, capture=number))
        with Recording(tmp_path / "c.h5") as recording:
            assert np.array_equal(recording.adc(0, 99), walk)
    assert not (tmp_path / "c-2.h5").exists()
    with pytest.raises(InputError, match="holds 2 captures, but capture is 3, expected 1 to 2"):
        import_recording(source, tmp_path / "c.h5", Given(CONFIG, capture=3))


def test_from_python_and_the_command_line(tmp_path):
    source = pcap(tmp_path / "a.pcap", CASES["two boards"])
    (tmp_path / "a.cfg").write_text(write_cfg(CONFIG))
    with pytest.raises(InputError, match=r"holds 2 captures \(from 192.168.33.180:4096 .*expected capture, 1 to 2"):
        rz.load(source)
    assert np.array_equal(rz.load(source, capture=2)[:].samples, WALKS[1])
    done = CliRunner().invoke(app, ["import", str(source), "-o", str(tmp_path / "b.h5")])
    assert done.exit_code == 0 and "capture 2 is in" in done.stderr and (tmp_path / "b-2.h5").exists()
    other = CliRunner().invoke(app, ["import", str(source), "-o", str(tmp_path / "c.h5"), "--capture", "2"])
    assert other.exit_code == 0 and "this is capture 2" in other.stderr


@pytest.mark.parametrize("seed", range(5))
def test_a_bad_network_starts_no_radar(tmp_path, seed):
    """Two starts with lost, repeated, late and forged packets, and a gap of half a walk."""
    rng, data = np.random.default_rng(seed), sent(np.concatenate([*WALKS] * 10))
    kept = [packet for packet in data if rng.random() > 0.05]
    for place in rng.integers(0, len(kept) - 80, 40):
        kept.insert(int(place + rng.integers(0, 60)), kept[place])
    for place in rng.integers(0, len(kept), 10):
        kept.insert(int(place), frame(struct.pack("<IIH", *rng.integers(0, 2**31, 2), 0) + bytes(1456)))
    del kept[len(kept) // 2 : len(kept) // 2 + 100]
    import_recording(pcap(tmp_path / "a.pcap", kept), tmp_path / "a.h5", Given(CONFIG))
    with Recording(tmp_path / "a.h5") as recording:
        assert "captures" not in recording.attributes["warnings"] and len(recording) >= 238


def test_packets_that_are_cut_or_split(tmp_path):
    whole = sent(WALKS[0])
    cut, split = [packet[:96] for packet in whole], [frame(p[42:], flags=0x2000)[:700] for p in whole]
    for data, why in ((cut, "packets were cut by the snap length"), (split, "packets were split into IP fragments")):
        count = len(data)
        with pytest.raises(InputError, match=f"a.pcap: {count} of {count} data {why}.*; expected whole packets"):
            import_recording(pcap(tmp_path / "a.pcap", data), tmp_path / "a.h5", Given(CONFIG))
        import_recording(
            pcap(tmp_path / "a.pcap", whole[:9] + data[9:12] + whole[12:]), tmp_path / "a.h5", Given(CONFIG)
        )
        with Recording(tmp_path / "a.h5") as recording:
            valid = recording.valid(0, 99)
            assert f"3 of {count} data {why}" in recording.attributes["warnings"] and not valid.all()
            assert np.array_equal(recording.adc(0, 99)[valid], WALKS[0][valid])
