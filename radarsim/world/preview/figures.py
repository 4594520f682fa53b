"""Pictures of a scene: a floor plan, and a rendering without the ceilings."""

from pathlib import Path

import numpy as np

from radarize.io.replacing import replacing
from radarsim.world.preview.blueprint import blueprint
from radarsim.world.preview.rendering import render
from radarsim.world.scene import Scene


def preview(scene: Scene, folder: str | Path, width: int = 1100, samples: int = 40) -> list[Path]:
    """Write ``NAME.plan.png`` and ``NAME.view.png`` into `folder` and return their paths.

    Args:
        scene: the world.
        folder: created if it does not exist.
        width, samples: of the rendering, pixels and paths per pixel.

    Raises:
        InputError: they cannot be written.
    """
    from PIL import Image

    folder = Path(folder)
    paths = [folder / f"{scene.name}.plan.png", folder / f"{scene.name}.view.png"]
    with replacing(paths[0]) as part:
        blueprint(scene).savefig(part, format="png", dpi=110, bbox_inches="tight")
    picture = Image.fromarray((255 * render(scene, width, samples)).astype(np.uint8))
    with replacing(paths[1]) as part:
        picture.save(part, format="png")
    return paths
