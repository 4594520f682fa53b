"""Panes and hollow bodies over the sweep, against the transfer matrix: positions of a pane's echo and of a rear
leaf's."""

import numpy as np
import pytest

from benchmarks.references.hollow_walls import NEAR, PANES, echoes, pane, peak, stud_wall
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject


@pytest.mark.parametrize("name", PANES)
def test_where_a_pane_echoes(name):
    """Between its faces, or in front of them by up to 6 mm where these nearly cancel, at the centre of the sweep."""
    (there, size), (place, level) = (peak(profile, -0.05, 0.05) for profile in pane(name))
    assert place == pytest.approx(there, abs=0.0015) and level == pytest.approx(size, abs=0.7)


def test_the_rear_leaf_of_a_stud_wall():
    truth, found = stud_wall()
    for low, high in ((-0.03, 0.04), (0.07, 0.15)):
        (there, size), (place, level) = peak(truth, low, high), peak(found, low, high)
        assert place == pytest.approx(there, abs=0.008) and level == pytest.approx(size, abs=1.5)
    assert peak(found, 0.07, 0.15)[1] - peak(found, -0.03, 0.04)[1] == pytest.approx(-14, abs=2)


def test_inner_faces_count_where_the_material_lets_through():
    """A cabinet of chipboard has inner faces; one of metal, or a solid wooden block, has none."""
    far = {}
    for name in ("chipboard", "metal", "wood"):
        found = echoes(SceneObject("cabinet", shapes.box((NEAR + 0.2, 0, 0), (0.4, 2, 2)), MATERIALS[name]))
        path = np.linalg.norm(found.images[:, :, 3], axis=1)
        far[name] = (np.abs(path / 2 - NEAR - 0.4) < 0.05) & found.through
    assert far["chipboard"].any() and not far["metal"].any() and not far["wood"].any()
