import numpy as np

from radarsim.scene.preview import preview, view
from radarsim.scene.scene import Scene


def test_pictures(tmp_path):
    room = Scene.load("physics/room")
    paths = preview(room, tmp_path / "new")
    assert [p.name for p in paths] == ["room.plan.png", "room.view.png"]
    assert all(p.stat().st_size > 2000 for p in paths)


def test_view_looks_into_the_rooms(office):
    picture = view(office, width=240, samples=1)
    assert picture.min() >= 0 and picture.max() <= 1
    carpet = (picture[..., 2] > picture[..., 0] + 0.08).mean()
    assert carpet > 0.05  # the ceiling is off: blue carpets are seen
    assert np.all(picture[0] == 1.0)  # background
