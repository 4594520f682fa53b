import numpy as np
import pytest

from radarize.io.errors import InputError
from radarize.io.exporters import export
from radarize.io.recording import RecordingWriter
from radarize.radar.presets import PRESETS

CONFIG = PRESETS["radarize"].model_copy(update={"loops": 2})


@pytest.fixture
def recording(tmp_path):
    with RecordingWriter(tmp_path / "a.h5", CONFIG) as writer:
        writer.append(np.ones((2, *CONFIG.frame_shape), np.int16), np.arange(2.0))
    return tmp_path / "a.h5"


@pytest.mark.parametrize("name", ["out", "out.bin", "out.cfg"])
def test_names(recording, tmp_path, name):
    assert export(recording, "bin", tmp_path / "new" / name) == tmp_path / "new" / "out.bin"
    assert sorted(p.name for p in (tmp_path / "new").iterdir()) == ["out.bin", "out.cfg"]


def test_refusals(recording, tmp_path):
    with pytest.raises(
        InputError, match="export format is 'wav', expected one of bin, map, ply, radarize-ae, ros2, roverd, tum"
    ):
        export(recording, "wav", tmp_path / "out")
    with pytest.raises(InputError, match="has no true poses"):
        export(recording, "tum", tmp_path / "out.tum")
    with pytest.raises(InputError, match="no such file"):
        export(tmp_path / "b.h5", "tum", tmp_path / "out.tum")
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be written"):
        export(recording, "bin", tmp_path / "file" / "out.bin")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.h5", "file"]
