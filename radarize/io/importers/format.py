"""What a format to read is."""

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
    """A format to read: the value of an entry point of the group ``radarize.importers``.

    Attributes:
        noun: what a source of it is called: "ROS bag".
        expected: what a user may give: "a ROS bag (.bag, .mcap, .db3 or a folder)".
        fits: whether a file or folder is of this format.
        open: opens a source as a `Capture`, given what the user says of it and a folder for what must be unpacked. None
            of a format without samples.
        write: writes the recording of a format without samples (such as one of pictures): source, output, what the user
            says, further data sets, progress. None of a format with samples.
        options: fields of `Given` that belong to this format and some others only.
        captures: what captures a source holds, in words, where it may hold several, of which `Given.capture` is one.
        last: asked after all other formats, such as one of any folder.
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
