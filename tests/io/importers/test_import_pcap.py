import struct
from pathlib import Path

import numpy as np
import pytest

from radarize.io.errors import InputError
from radarize.io.importers import Given, import_recording
from radarize.io.recording import Recording
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import Packet, encode
from tests.packets import packets

PUBLIC = {"samples": 256, "loops": 16, "rx": 1}
CONFIG = RadarConfig(
    start_frequency=77e9,
    slope=60e12,
    idle_time=20e-6,
    adc_start_time=5e-6,
    ramp_end_time=60e-6,
    samples=64,
    sample_rate=5e6,
    loops=3,
    frame_period=50e-3,
    tx_order=(0, 2, 1),
)
FRAMES = np.random.default_rng(0).integers(-(2**15), 2**15, (5, *CONFIG.frame_shape), dtype=np.int16)


def udp(payload: bytes, port: int = 4098, vlan: bool = False, options: int = 0) -> bytes:
    header = bytes(12) + (b"\x81\x00\x00\x05" if vlan else b"") + b"\x08\x00"
    words = 5 + options
    length = 4 * words + 8 + len(payload)
    ip = struct.pack(">BBHHHBBH4s4s", 0x40 | words, 0, length, 0, 0, 64, 17, 0, bytes(4), bytes(4)) + bytes(4 * options)
    return header + ip + struct.pack(">HHHH", 1024, port, 8 + len(payload), 0) + payload


def pcap(path: Path, data: list[bytes], order: str = "<", magic: int = 0xA1B2C3D4, link: int = 1) -> Path:
    records = b"".join(struct.pack(order + "IIII", 1000 + i, 500_000, len(d), len(d)) + d for i, d in enumerate(data))
    path.write_bytes(struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 65535, link) + records)
    return path


#: A section and its interface (Ethernet, microseconds), as the draft gives them.
SECTION = struct.pack("<IIIHHqI", 0x0A0D0D0A, 28, 0x1A2B3C4D, 1, 0, -1, 28)
INTERFACE = struct.pack("<IIHHII", 1, 20, 1, 0, 0, 20)


def pcapng(path: Path, data: list[bytes]) -> Path:
    """Write a file field by field from the draft, independently of the library that reads it."""
    blocks = [SECTION, INTERFACE, struct.pack("<III", 5, 12, 12)]  # and an irrelevant one
    for i, packet in enumerate(data):
        padded = packet + bytes(-len(packet) % 4)
        high, low = divmod(int((1000 + i + 0.5) * 1e6), 2**32)
        length = 32 + len(padded)
        head = struct.pack("<IIIIIII", 6, length, 0, high, low, len(packet), len(packet))
        blocks.append(head + padded + struct.pack("<I", length))
    path.write_bytes(b"".join(blocks))
    return path


def stream(frames: np.ndarray = FRAMES) -> list[bytes]:
    return [udp(packet.encode()) for packet in packets(encode(frames, CONFIG).tobytes())]


def imported(source: Path, config: RadarConfig | None = CONFIG, **more) -> Recording:
    return Recording(import_recording(source, source.with_suffix(".h5"), Given(config=config, **more)))


# --- the public capture ----------------------------------------------------------------------------------------------
def test_known_echoes_of_the_public_capture(recordings, tmp_path):
    source = recordings / "iwr1843-pcap" / "test_one_frame.pcap"
    with Recording(import_recording(source, tmp_path / "a.h5", Given(overrides=PUBLIC))) as recording:
        assert len(recording) == 1
        assert recording.config.iq_order == "qqii"
        assert recording.valid(0, 1).all()
        assert recording.attributes["warnings"].startswith("a single chirp per loop, of TX1, is assumed")
        adc = recording.adc(0, 1)[0, :, 0, 0].astype(float)
    signal = adc[..., 0] + 1j * adc[..., 1]
    spectrum = np.fft.fft((signal - signal.mean(axis=1, keepdims=True)) * np.hanning(256), axis=1)
    power = (np.abs(spectrum) ** 2).mean(axis=0)
    peaks = [k for k in range(5, 250) if power[k] == power[k - 3 : k + 4].max()]
    assert sorted(peaks, key=lambda k: -power[k])[:2] == [59, 39]
    # A static room: chirps are equal (README: correlation 0.998).
    unit = signal / np.linalg.norm(signal, axis=1, keepdims=True)
    assert np.abs((unit[1:] * unit[:-1].conj()).sum(axis=1)).mean() == pytest.approx(0.998, abs=0.001)


def test_the_samples_win_over_the_default_iq_order_but_not_over_the_users(recordings, tmp_path):
    source = recordings / "iwr1843-pcap" / "test_one_frame.pcap"
    forced = import_recording(source, tmp_path / "a.h5", Given(overrides=PUBLIC | {"iq_order": "iiqq"}))
    with Recording(forced) as recording:
        assert recording.config.iq_order == "iiqq"


def test_a_capture_of_commands_alone_has_no_frame(recordings, tmp_path):
    with pytest.raises(InputError, match="holds 0 bytes of samples in 0 data packets.*port 4098"):
        import_recording(recordings / "iwr1843-pcap" / "test_cmd.pcap", tmp_path / "a.h5", Given(overrides=PUBLIC))
    assert not (tmp_path / "a.h5").exists()


def test_the_public_capture_has_less_than_a_frame_of_a_foreign_cfg(recordings, tmp_path):
    folder = recordings / "iwr1843-pcap"
    from radarize.radar.presets import load_config

    config, _ = load_config(folder / "xwr18xx_profile_2023_01_01T00_00_00_000.cfg")
    with pytest.raises(InputError, match=f"holds 16384 bytes .* expected at least one frame of {config.frame_bytes}"):
        import_recording(folder / "test_one_frame.pcap", tmp_path / "a.h5", Given(config=config))


# --- the format ------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("magic", [0xA1B2C3D4, 0xA1B23C4D])
@pytest.mark.parametrize("order", ["<", ">"])
def test_byte_orders_and_time_units(tmp_path, order, magic):
    with imported(pcap(tmp_path / "a.pcap", stream(), order, magic)) as recording:
        assert np.array_equal(recording.adc(0, 5), FRAMES)
        fraction = 0.5 if magic == 0xA1B2C3D4 else 0.0005
        assert recording.attributes["first_packet_time"] == pytest.approx(1000 + fraction)


def test_wiresharks_own_format(tmp_path):
    with imported(pcapng(tmp_path / "a.pcapng", stream())) as recording:
        assert np.array_equal(recording.adc(0, 5), FRAMES)
        assert recording.attributes["first_packet_time"] == pytest.approx(1000.5)
    with imported(pcapng(tmp_path / "b.dat", stream())) as recording:  # by its first bytes
        assert len(recording) == 5


def test_a_length_that_cannot_be_ends_the_capture(tmp_path):
    source = pcapng(tmp_path / "a.pcapng", stream())
    for length in (0, 4, 2**32 - 1):
        source.write_bytes(pcapng(source, stream()).read_bytes() + struct.pack("<II", 6, length))
        with imported(source) as recording:
            assert np.array_equal(recording.adc(0, 5), FRAMES)
            assert f"has a block of {length} bytes; what follows is left out" in recording.attributes["warnings"]


def test_other_traffic_is_passed_over(tmp_path):
    noise = [b"", bytes(10), bytes(60), udp(b"\x5a\xa5\x09\x00", port=4096), b"\xff" * 1500, udp(b"")]
    data = [packet for pair in zip(stream(), noise * 99, strict=False) for packet in pair]
    with imported(pcap(tmp_path / "a.pcap", data)) as recording:
        assert np.array_equal(recording.adc(0, 5), FRAMES)


def test_vlan_tags_and_ip_options(tmp_path):
    raw = list(packets(encode(FRAMES, CONFIG).tobytes()))
    data = [udp(p.encode(), vlan=i % 2 == 0, options=i % 3) for i, p in enumerate(raw)]
    with imported(pcap(tmp_path / "a.pcap", data)) as recording:
        assert np.array_equal(recording.adc(0, 5), FRAMES)


def test_lost_late_and_repeated_packets(tmp_path):
    data = stream()
    data[3], data[4] = data[4], data[3]
    data.insert(9, data[8])
    del data[12]  # packet 11, counted from 0, after the repeated one: bytes 16016 to 17472
    with imported(pcap(tmp_path / "a.pcap", data)) as recording:
        adc, valid = recording.adc(0, 5), recording.valid(0, 5)
        assert "1456 bytes were lost" in recording.attributes["warnings"]
    fired = valid[:, :, [0, 2, 1]].reshape(-1)  # TX1, TX3, TX2
    assert np.flatnonzero(~fired).tolist() == _lost(16016)
    assert np.array_equal(adc[valid], FRAMES[valid])


def _lost(offset: int) -> list[int]:
    chirp = CONFIG.frame_bytes // 9
    return list(range(offset // chirp, (offset + 1455) // chirp + 1))


@pytest.mark.parametrize("cut", [1, 15, 17, 1000, 1482, 1500, 5000])
@pytest.mark.parametrize("write", [pcap, pcapng])
def test_a_truncated_file_keeps_its_whole_frames(tmp_path, cut, write):
    source = write(tmp_path / "a.pcap", stream())
    source.write_bytes(source.read_bytes()[:-cut])
    with imported(source) as recording:
        assert len(recording) == 4
        assert np.array_equal(recording.adc(0, 4), FRAMES[:4])
        assert "incomplete last frame" in recording.attributes["warnings"]


@pytest.mark.parametrize(
    "data, message",
    [
        (b"", "starts with nothing"),
        (b"\xd4\xc3\xb2\xa1", "expected a pcap or pcapng header"),
        (b"\x0a\x0d\x0d\x0a" + bytes(60), "broken pcapng section"),
        (SECTION, "IDB not found"),
        (SECTION + INTERFACE, "holds 0 bytes"),
        (SECTION + INTERFACE[:8] + b"\x71\0" + INTERFACE[10:], "link type 113"),
        (SECTION + struct.pack("<II", 1, 2**31), "a block of 2147483648 bytes"),
        (bytes(100), "starts with 00000000"),
        (struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 113), "link type 113"),
        (struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1), "holds 0 bytes"),
        (struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1) + b"\xff" * 500, "holds 0 bytes"),
    ],
)
def test_files_without_anything_usable(tmp_path, data, message):
    source = tmp_path / "a.pcap"
    source.write_bytes(data)
    with pytest.raises(InputError, match=message) as error:
        imported(source)
    assert "\n" not in str(error.value)
    assert not list(tmp_path.glob("*.h5*"))


def test_byte_counts_that_leap_are_damage_not_loss(tmp_path):
    """200 MB between two packets of a small file would be 40,000 frames of zeros."""
    sent = list(packets(encode(FRAMES, CONFIG).tobytes()))
    far = [Packet(99 + k, 200_000_000 + len(sent[1].payload) * k, sent[1].payload) for k in range(4)]
    source = pcap(tmp_path / "a.pcap", [udp(packet.encode()) for packet in (*sent, *far)])
    with pytest.raises(InputError, match="a.pcap: lacks more than .* expected byte counts that increase"):
        imported(source)
    assert not (tmp_path / "a.h5").exists()
