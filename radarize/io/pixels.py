"""Safe reader of foreign images: sizes in headers are checked before unpacking."""

from pathlib import Path
from typing import BinaryIO

import numpy as np
from jaxtyping import UInt
from PIL import Image

from radarize.io.errors import InputError, explained
from radarize.io.files import regular

#: Maximum number of pixels of an image: a map of 200 m x 200 m with cells of 5 cm.
MOST_PIXELS = 16 << 20


def read_picture(
    source: Path | BinaryIO, name: str, formats: tuple[str, ...] = ("PNG",), most: int = MOST_PIXELS, gray: bool = True
) -> UInt[np.ndarray, "row column ..."]:
    """Read the pixels of an image.

    Args:
        source: a file, or its content.
        name: name in errors.
        formats: allowed formats, as in Pillow.
        most: maximum number of pixels.
        gray: convert to 8 bits of brightness; else unchanged.

    Raises:
        InputError: not such an image, or it has more pixels.
    """
    if isinstance(source, Path):
        regular(source, "a picture")
    kinds = "/".join(formats)
    with explained(f"{name}: is no readable {kinds} picture"), Image.open(source, formats=formats) as image:
        if image.width * image.height > most:
            raise InputError(f"{name}: has {image.width} x {image.height} pixels, expected at most {most}")
        return np.asarray(image.convert("L") if gray else image)
