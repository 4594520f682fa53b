"""Draws a real building as a scene: python -m docs.imported_plan ../shared/recordings/radish/intel-corrected.log.gz"""

import sys
import tempfile
from pathlib import Path

from PIL import Image

from radarsim.world.importers import import_scene
from radarsim.world.preview.figures import preview
from radarsim.world.scene import Scene

HERE = Path(__file__).parent / "pictures"
HEIGHT = 620  # px


def main(log: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        scene = Scene.load(import_scene(log, Path(folder)).path)
        pictures = [Image.open(path).convert("RGB") for path in preview(scene, folder)]
    pictures = [picture.resize((picture.width * HEIGHT // picture.height, HEIGHT)) for picture in pictures]
    whole = Image.new("RGB", (sum(picture.width for picture in pictures), HEIGHT), "white")
    left = 0
    for picture in pictures:
        whole.paste(picture, (left, 0))
        left += picture.width
    whole.quantize(64).save(HERE / f"{scene.name}.png", optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
