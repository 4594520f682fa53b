"""Definition of a format that can be imported."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from radarize.io.importers.capture import Capture
from radarize.io.importers.parameters import Given
from radarize.io.plugins import Plugins
from radarize.io.recording import Product

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Format:
    """A format that can be imported: the value of an entry point of the group ``radarize.importers``.

    Attributes:
        noun: name of a source, such as "ROS bag".
        expected: what the user may give, such as "a ROS bag (.bag, .mcap, .db3 or a folder)".
        fits: whether a file or folder has this format.
        open: opens a source as a `Capture`, from the user's settings and a folder for unpacking. None for a format
            without samples.
        write: writes the recording of a format without samples, such as images: source, output, user's settings,
            further data sets, progress. None for a format with samples.
        options: fields of `Given` that only this and some other formats have.
        captures: returns descriptions of the captures in a source that may have several; `Given.capture` selects one.
        last: tried after all other formats, such as one that accepts any folder.
    """

    noun: str
    expected: str
    fits: Callable[[Path], bool]
    open: Callable[[Path, Given, Path], Capture] | None = None
    write: Callable[[Path, Path, Given, Mapping[str, Product], Progress], Path] | None = None
    options: tuple[str, ...] = ()
    last: bool = False
    captures: Callable[[Path], Sequence[str]] | None = None


FORMATS: Plugins[Format] = Plugins("radarize.importers", "format")
