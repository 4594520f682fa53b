"""Pictures from elsewhere, whose headers are asked before anything is unpacked."""

from pathlib import Path
from typing import BinaryIO

import numpy as np
from jaxtyping import UInt
from PIL import Image

from radarize.io.errors import InputError, explained
from radarize.io.files import regular

#: Pixels of a picture: a map of 200 m x 200 m in cells of 5 cm.
MOST_PIXELS = 16 << 20


def read_picture(
    source: Path | BinaryIO, name: str, formats: tuple[str, ...] = ("PNG",), most: int = MOST_PIXELS, gray: bool = True
) -> UInt[np.ndarray, "row column ..."]:
    """A picture's pixels.

    Args:
        source: a file, or its content.
        name: what errors call it.
        formats: that it may have, as Pillow calls them.
        most: pixels that it may have.
        gray: as 8 bits of brightness; else as they are.

    Raises:
        InputError: no such picture, or it has more pixels.
    """
    if isinstance(source, Path):
        regular(source, "a picture")
    kinds = "/".join(formats)
    with explained(f"{name}: is no readable {kinds} picture"), Image.open(source, formats=formats) as image:
        if image.width * image.height > most:
            raise InputError(f"{name}: has {image.width} x {image.height} pixels, expected at most {most}")
        return np.asarray(image.convert("L") if gray else image)
