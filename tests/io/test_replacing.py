"""A full disk is reported with the file's name, whichever call finds it."""

import errno

import pytest

from radarize.io.errors import InputError
from radarize.io.replacing import replacing
from radarsim.world.importers import import_scene
from radarsim.world.preview.figures import preview


@pytest.mark.parametrize(
    "error",
    [OSError(errno.ENOSPC, "No space left on device"), RuntimeError("write failed: No space left on device (28)")],
)
def test_a_full_disk(tmp_path, error):
    (tmp_path / "a.png").write_text("before")
    with pytest.raises(InputError, match=r"a.png: cannot be written \(no space left on the device\)"):
        with replacing(tmp_path / "a.png") as part:
            part.write_text("half")
            raise error
    assert (tmp_path / "a.png").read_text() == "before" and len(list(tmp_path.iterdir())) == 1


def test_other_errors_stay_what_they_are(tmp_path):
    with pytest.raises(ZeroDivisionError), replacing(tmp_path / "a.png"):
        raise ZeroDivisionError


def full(*_, **__):
    raise OSError(errno.ENOSPC, "No space left on device")


def test_pictures_and_meshes_of_scenes(tmp_path, monkeypatch):
    from types import SimpleNamespace

    monkeypatch.setattr("radarsim.world.preview.figures.blueprint", lambda scene: SimpleNamespace(savefig=full))
    with pytest.raises(InputError, match="a.plan.png: cannot be written"):
        preview(SimpleNamespace(name="a"), tmp_path)
    monkeypatch.setattr("pathlib.Path.write_bytes", full)
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 9 0 0\nv 0 9 0\nv 0 0 3\nf 1 2 3\nf 1 2 4\n")
    with pytest.raises(InputError, match="b.yaml: cannot be written"):
        import_scene(tmp_path / "a.obj", tmp_path / "b.yaml")
