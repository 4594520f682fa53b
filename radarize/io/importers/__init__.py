"""Import of recordings from other formats, one module per format.

A `Format` opens its files as a `Capture`: samples in batches of complete frames, with further data. The next steps are
the same for all formats: determine the order of I and Q, stamp the frames, write the recording. Other packages add
formats by entry points of the group ``radarize.importers``.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np

from radarize.io.errors import InputError
from radarize.io.files import regular
from radarize.io.hdf5 import open_hdf5
from radarize.io.importers.capture import Capture, CapturedFrames
from radarize.io.importers.format import FORMATS, Format
from radarize.io.importers.parameters import Given
from radarize.io.recording import Product, RecordingWriter
from radarize.io.tum import read_tum
from radarize.radar.array import losses
from radarize.radar.cfg import assumed_board, remarks
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import range_balance
from radarize.radar.limits import outside_band

__all__ = ["Given", "captures", "import_recording"]

#: dB from which on the samples determine the order of I and Q.
_CERTAIN_DB = 10.0
#: Number of frames examined for it.
_ASKED = 8
#: Streams that poses from a file replace.
_POSES = ("truth/time", "truth/pose", "truth/velocity")


def import_recording(
    source: Path,
    output: Path,
    given: Given | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Path:
    """Write a recording (.h5) from a capture of another format.

    Frames are stamped as in the source, else ``start_time + index * frame_period``. The recording's attribute
    ``warnings`` lists what the user should know (a truncated last frame, lost packets, doubtful settings), ``assumed``
    the settings that were assumed, and ``found`` those determined from the samples.

    Args:
        source: a DCA1000 ``.bin``, whole or in parts (its ``.cfg`` of the same name, or mmWave Studio's JSON files, may
            be beside it), a ``.pcap`` or ``.pcapng`` of its UDP stream, a folder of mmWave Studio files, a ROS bag, an
            array of samples (``.npy``, ``.npz``, ``.mat``), a sequence in roverd's layout, or a walk (``given.walk``)
            of RadarHD's data set of images.
        output: recording to write; if a network capture has several starts of the radar, boards or ports, each is
            written, the second to ``NAME-2.h5``, unless ``given.capture`` selects one.
        given: settings from the user.
        progress: called with (frames done, estimated frames in all).

    Raises:
        InputError: unknown format, nothing usable in the source, or a configuration that does not fit it.
    """
    source, output = Path(source), Path(output)
    given = given or Given()
    start_time = float(given.start_time or 0.0)
    if source.resolve() == output.resolve():
        raise InputError(f"{output}: is the source itself, expected another output file")
    products = _poses(Path(given.poses)) if given.poses else {}
    format = _format(source, given)
    if given.capture is None and len(several := format.captures(source) if format.captures else ()) > 1:
        return _import_all(source, output, given, len(several), progress)
    if format.write:
        return format.write(source, output, given, products, progress)
    assert format.open is not None  # a format has one or the other
    capture = format.open(source, given, output.parent)
    batches = iter(capture.batches)
    first = next(batches)
    if given.start_time is not None and first.times is not None:
        raise InputError(f"{source}: has stamps of its own, but start_time is {given.start_time}, expected none")
    if "tx_order" in capture.assumed:
        capture.warnings.append(
            "a single chirp per loop, of TX1, is assumed; if the capture has two transmitters, all speeds are doubled: "
            "give the number of transmitters with --tx"
        )
    capture.warnings += _of_the_radar(capture, given)
    radar, swapped = _settle_iq_order(capture, first, "iq_order" in given.overrides)
    streams = {name: each for name, each in capture.streams.items() if not products or not name.startswith(_POSES)}
    writer = RecordingWriter(
        output,
        radar,
        cfg_text=capture.cfg_text,
        attributes={"source": source.name, **capture.attributes},
        streams=streams,
        products={**capture.products, **products},
    )
    done, last = 0, start_time
    with writer:
        for batch in chain([first], batches):
            stamps = batch.times
            if stamps is None:
                stamps = start_time + radar.frame_period * np.arange(done, done + len(batch.valid))
            frames = batch.frames[..., ::-1] if swapped else batch.frames
            writer.append(frames, stamps, batch.valid, rows={name: batch.rows[name] for name in streams})
            start_time = stamps[0] if not done else start_time
            done, last = done + len(batch.valid), stamps[-1]
            progress(done, max(done, capture.expected_frames))
        if given.poses:
            end = last + radar.frame_period
            capture.warnings += _overlap_warning(products["truth/time"].data, start_time, end, given.poses)
        capture.warnings += writer.losses.warnings()
        writer.annotate(warnings="; ".join(capture.warnings), assumed=", ".join(capture.assumed))
    return output


def _of_the_radar(capture: Capture, given: Given) -> list[str]:
    """Return warnings about a board of another band and an assumed board, and remarks on losses due to the firing
    order."""
    outside = outside_band(capture.config)
    found = [f"{outside}: --board sets another one"] if outside else []
    if given.overrides.get("board") is not None:
        return [*found, *losses(capture.config)]
    if not capture.cfg_text and given.config is None and not capture.board_known:
        found.append(assumed_board(capture.config))
    return [*found, *remarks(capture.cfg_text, capture.config)]


def captures(source: Path, given: Given) -> Sequence[str]:
    """Return descriptions of the captures in a source; none if its format has a single one.

    Raises:
        InputError: unknown format.
    """
    format = _format(source, given)
    return format.captures(source) if format.captures else ()


def _import_all(source: Path, output: Path, given: Given, count: int, progress: Callable[[int, int], None]) -> Path:
    """Write a recording of each capture in a source, the second one to ``NAME-2.h5``, and return the first.

    Raises:
        InputError: one of the files but the first exists, or no capture can be read.
    """
    outputs = [output, *(output.with_stem(f"{output.stem}-{number}") for number in range(2, count + 1))]
    for number, path in enumerate(outputs[1:], 2):
        if path.exists():
            raise InputError(
                f"{path}: already exists, and capture {number} of {count} in {source} would replace it, expected "
                f"another output, or capture, 1 to {count}"
            )
    written, notes = [], []
    for number, path in enumerate(outputs, 1):
        try:
            written.append(import_recording(source, path, replace(given, capture=number), progress))
            notes.append(f"capture {number} is in {path}")
        except InputError as error:
            failed = error
            notes.append(f"capture {number} is left out ({error})")
    if not written:
        raise failed
    for path in written:
        with open_hdf5(path, mode="r+") as file:
            file.attrs["warnings"] = "; ".join([*filter(None, [str(file.attrs.get("warnings", ""))]), *notes])
    return written[0]


def _poses(path: Path) -> dict[str, Product]:
    """Return the poses of a TUM file as data sets of a recording, at their own times."""
    times, poses = read_tum(path)
    return {
        "truth/time": Product(times, "s", f"stamps of the poses of {path.name}"),
        "truth/pose": Product(poses, "m; x y z qx qy qz qw", "sensor in the world"),
    }


def _overlap_warning(times: np.ndarray, start: float, end: float, poses: Path) -> list[str]:
    """Return a warning if no pose is within the time of the recording, probably because of two clocks."""
    if times[-1] >= start and times[0] <= end:
        return []
    return [
        f"{poses} covers {times[0]:.3f} to {times[-1]:.3f} s, but the frames {start:.3f} to {end:.3f} s: "
        "give start_time to put both on one clock"
    ]


def _format(source: Path, given: Given) -> Format:
    """Return the format of a source.

    Raises:
        InputError: the format is unknown, or an option belongs to another format.
    """
    formats = sorted(FORMATS.values(), key=lambda each: each.last)
    expected = ", ".join(each.expected for each in formats)
    if not source.is_dir():
        regular(source, expected)
    found = next((each for each in formats if each.fits(source)), None)
    if found is None:
        raise InputError(f"{source}: unknown format, expected {expected}")
    for other in formats:
        for name in set(other.options) - set(found.options):
            if (value := getattr(given, name)) != getattr(Given(), name):
                raise InputError(f"{source}: is no {other.noun}, but {name} is {value}, expected none")
    return found


def _settle_iq_order(capture: Capture, batch: CapturedFrames, given: bool) -> tuple[RadarConfig, bool]:
    """Return the configuration with the I/Q order that the samples show, if it was assumed, and whether to swap them.

    If the samples contradict a given order, a warning is added.
    """
    config = capture.config
    decibels = range_balance(batch.frames[:_ASKED])
    other = "iiqq" if config.iq_order == "qqii" else "qqii"
    if given or config.iq_order == "real" or abs(decibels) < _CERTAIN_DB:
        return config, False
    if "iq_order" in capture.assumed:
        found = config.iq_order if decibels > 0 else other
        capture.attributes["found"] = f"iq_order {found} ({abs(decibels):.0f} dB more energy at near range)"
        return config.model_copy(update={"iq_order": found}), decibels < 0
    if decibels < 0:
        capture.warnings.append(
            f"iq_order is {config.iq_order} in the configuration, but the samples look like {other} "
            f"({-decibels:.0f} dB more energy at near range)"
        )
    return config, False
