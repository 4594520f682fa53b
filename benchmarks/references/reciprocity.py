"""References for `tests/propagation/test_multipath.py` and the gallery."""

import numpy as np

from radarize.radar.presets import PRESETS
from radarsim.propagation.paths import Kind
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.shapes import rectangle

CONFIG = PRESETS["radarize"]

LAMBDA = CONFIG.wavelength


def sheet(name, material, position, size, facing):
    return SceneObject(name, rectangle(position, size, facing), MATERIALS.get(material, material))


DOOR = sheet("door", "metal", (2.0, 0, 0), (3.0, 2.4), (-1, 0, 0))


def there_and_back(echoes, place):
    """Return the field of each echo from one antenna beside a position to another, and with TX and RX exchanged."""

    def field(tx, rx):
        lengths = np.empty(len(echoes))
        points = np.linalg.norm(tx - echoes.points[:, 0], axis=1) + np.linalg.norm(echoes.points[:, 1] - rx, axis=1)
        lengths[echoes.kind == Kind.POINT] = points
        images = np.linalg.norm(tx - echoes.images[:, :, :3] @ rx - echoes.images[:, :, 3], axis=1)
        lengths[echoes.kind == Kind.IMAGE] = images
        curved = echoes.kind == Kind.CURVED
        ends = echoes[curved].apparent(place)
        lengths[curved] = np.linalg.norm(tx - ends[:, 0], axis=1) + np.linalg.norm(ends[:, 1] - rx, axis=1)
        return echoes.amplitude * np.exp(2j * np.pi * lengths / LAMBDA)

    one, other = place + [0.0, 0.010, 0.002], place - [0.0, 0.012, 0.003]
    return field(one, other), field(other, one)
