import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from radarize.io.errors import InputError
from radarize.io.exporters import export
from radarize.io.importers import Given, import_recording
from radarize.io.recording import Recording
from radarize.radar.cfg import assumed_board

ISK = "iwr6843isk"


@pytest.fixture
def folder(recordings, tmp_path) -> Path:
    copy = tmp_path / "capture"
    shutil.copytree(recordings / "iwr6843-studio", copy, copy_function=shutil.copyfile)
    copy.chmod(0o755)
    return copy


@pytest.mark.parametrize("source", ["", "adc_data.bin"])
def test_known_echoes_of_the_public_capture(recordings, tmp_path, source):
    source = recordings / "iwr6843-studio" / source
    with Recording(import_recording(source, tmp_path / "a.h5")) as recording:
        assert len(recording) == 1
        assert recording.config.frame_shape == (85, 3, 4, 512, 2)
        # Its setup names iwr6843, the chip of three boards.
        assert recording.attributes["warnings"] == assumed_board(recording.config) and recording.config.board == ISK
        adc = recording.adc(0, 1)[0].astype(float)
        ranges = recording.config.ranges
    signal = (adc[..., 0] + 1j * adc[..., 1]).mean(axis=0)  # nearly static: loops add up
    power = (np.abs(np.fft.fft(signal * np.hanning(512))) ** 2).mean(axis=(0, 1))
    peaks = [ranges[k] for k in range(10, 500) if power[k] == power[k - 1 : k + 2].max()]
    for known in (1.06, 1.57, 1.73, 1.84, 8.48):
        assert min(abs(peak - known) for peak in peaks) < 0.03
    strongest = sorted(range(10, 500), key=lambda k: -power[k])[0]
    assert ranges[strongest] == pytest.approx(1.57, abs=0.03)


@pytest.mark.parametrize("samples", [450, 500, 510])
def test_a_wrong_sample_count_is_refused(recordings, tmp_path, samples):
    with pytest.raises(InputError, match=f"repeat every 6144 and not every {12 * samples}"):
        given = Given(overrides={"samples": samples, "loops": 30})
        import_recording(recordings / "iwr6843-studio", tmp_path / "a.h5", given)


def test_export_gives_the_captured_file_back(recordings, tmp_path):
    source = recordings / "iwr6843-studio"
    import_recording(source, tmp_path / "a.h5")
    binary = export(tmp_path / "a.h5", "bin", tmp_path / "b")
    assert binary == tmp_path / "b.bin"
    assert binary.read_bytes() == (source / "adc_data.bin").read_bytes()
    import_recording(binary, tmp_path / "c.h5")
    with Recording(tmp_path / "a.h5") as a, Recording(tmp_path / "c.h5") as c:
        assert a.config == c.config
        assert np.array_equal(a.adc(0, 1), c.adc(0, 1))


def test_missing_and_ambiguous_files(folder, tmp_path):
    out = tmp_path / "a.h5"
    settings = folder / "mmwaveDevice.mmwave.json"
    shutil.copyfile(settings, folder / "other.mmwave.json")
    with pytest.raises(InputError, match=r"has 2 files \*.mmwave.json"):
        import_recording(folder, out)
    (folder / "other.mmwave.json").unlink()
    (folder / "adc_data.bin").rename(folder / "renamed.bin")
    import_recording(folder, out)  # the only .bin there is
    (folder / "renamed.bin").unlink()
    with pytest.raises(InputError, match=r"has 0 files \*.bin"):
        import_recording(folder, out)
    settings.unlink()
    with pytest.raises(InputError, match=r"has 0 files \*.mmwave.json"):
        import_recording(folder, out)


def test_several_captured_files_are_joined(folder, tmp_path):
    data = (folder / "adc_data.bin").read_bytes()
    (folder / "adc_data.bin").write_bytes(data[:1_000_001])  # cut anywhere, even within a word
    (folder / "adc_data_1.bin").write_bytes(data[1_000_001:])
    setup = folder / "CaptureSetup.setup.json"
    content = json.loads(setup.read_text())
    content["capturedFiles"]["files"].append(
        {"processedFileName": "..\\..\\adc_data_1.bin", "processedFileSummary": {"numZeroFillBytes": 12}}
    )
    setup.write_text(json.dumps(content))
    import_recording(folder, tmp_path / "a.h5")
    with Recording(tmp_path / "a.h5") as recording:
        assert len(recording) == 1
        assert "12 bytes were lost" in recording.attributes["warnings"]
    assert export(tmp_path / "a.h5", "bin", tmp_path / "b").read_bytes() == data
