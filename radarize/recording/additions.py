"""What a finished recording gets later."""

import shutil
from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np

from radarize.errors import InputError, reason
from radarize.recording.streams import Product, Stream
from radarize.recording.writer import grow
from radarize.replacing import replacing


def add(
    path: Path,
    streams: Mapping[str, Stream],
    rows: Mapping[str, np.ndarray],
    products: Mapping[str, Product] | None = None,
    attributes: Mapping[str, object] | None = None,
) -> Path:
    """Add streams to a recording, which is replaced as a whole.

    Args:
        path: recording, which nobody writes.
        streams: by path.
        rows: of each stream, all.
        products: data sets written once, by path.
        attributes: of the file, to replace or add.

    Raises:
        InputError: it is there already, or the file cannot be written.
    """
    with replacing(path) as part:
        shutil.copyfile(path, part)
        try:
            with h5py.File(part, "r+", libver="latest") as file:
                for name in (*streams, *(products or {})):
                    if name in file:
                        raise InputError(f"{path}: has /{name} already, expected a recording without")
                for name, stream in streams.items():
                    data = grow(file, name, stream)
                    data.resize(len(rows[name]), axis=0)
                    data[:] = rows[name]
                for name, product in (products or {}).items():
                    file.create_dataset(name, data=product.data).attrs.update(
                        {"unit": product.unit, "about": product.about}
                    )
                file.attrs.update(attributes or {})
        except (OSError, RuntimeError) as error:
            raise InputError(f"{path}: cannot be added to ({reason(error)})") from error
    return path
