"""Recordings from foreign files, one module per format.

A format opens its files as a `Capture`: samples in batches of whole frames, with whatever came along. What follows is
the same for all: settle the order of I and Q, stamp the frames, write the recording.
"""

from collections.abc import Callable
from itertools import chain
from pathlib import Path

import numpy as np

from radarize.errors import InputError, explained
from radarize.files import regular
from radarize.importers import bin as bin_format
from radarize.importers import cube as cube_format
from radarize.importers import pcap as pcap_format
from radarize.importers import pictures as picture_format
from radarize.importers import rover as rover_format
from radarize.importers import studio as studio_format
from radarize.importers.capture import Batch, Capture
from radarize.importers.parameters import Given
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import range_balance
from radarize.radar.presets import load_config
from radarize.recording import Product, RecordingWriter
from radarize.tum import read_tum

__all__ = ["Given", "import_recording"]

#: From this many dB on, the samples themselves say which of I and Q comes first.
_CERTAIN_DB = 10.0
#: Frames that are asked.
_ASKED = 8
_BAGS, _ARRAYS = (".bag", ".mcap", ".db3"), (".npy", ".npz", ".mat")
_EXPECTED = (
    "a DCA1000 .bin, a .pcap or .pcapng, a folder of mmWave Studio files, a ROS bag (.bag, .mcap, .db3 or a folder), "
    "an array (.npy, .npz, .mat), a sequence in roverd's layout, or RadarHD's dataset_5"
)
#: What poses given by hand stand in for.
_POSES = ("truth/time", "truth/pose", "truth/velocity")


def import_recording(
    source: Path,
    output: Path,
    given: Given | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Path:
    """Write a recording (.h5) from a capture.

    Frames are stamped as the source says, else ``start_time + index * frame_period``. What the user should know (a
    truncated last frame, lost packets, doubtful settings) is joined in the recording's attribute ``warnings``; settings
    that nobody gave are named in ``assumed``; what the samples told of them is in ``found``.

    Args:
        source: a DCA1000 ``.bin``, whole or in parts (its ``.cfg`` of the same name, or mmWave Studio's JSON files, may
            lie beside it), a ``.pcap`` or ``.pcapng`` of its UDP stream, a folder of mmWave Studio files, a ROS bag, an
            array of samples (``.npy``, ``.npz``, ``.mat``), a sequence in roverd's layout, or RadarHD's data set of
            pictures, of which ``given.walk`` is taken.
        output: recording to write.
        given: what the user says of it.
        progress: called with frames done and (estimated) frames in all.

    Raises:
        InputError: unknown format, nothing usable in the source, or a configuration that does not fit it.
    """
    source, output = Path(source), Path(output)
    given = given or Given()
    start_time = float(given.start_time or 0.0)
    if source.resolve() == output.resolve():
        raise InputError(f"{output}: is the source itself, expected another output file")
    products = _poses(given.poses) if given.poses else {}
    if picture_format.asked(source, given.walk):
        return picture_format.import_walk(
            source, given.walk, output, products, progress or (lambda done, total: None), align=given.align
        )

    capture = _open(source, output, given)
    batches = iter(capture.batches)
    first = next(batches)
    if given.start_time is not None and first.times is not None:
        raise InputError(f"{source}: has stamps of its own, but start_time is {given.start_time}, expected none")
    if "tx_order" in capture.assumed:
        capture.warnings.append(
            "one chirp a loop is assumed, of TX1: of a capture with two transmitters, all speeds would be doubled; "
            "--tx says how many there are"
        )
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
        if products:
            end = last + radar.frame_period
            capture.warnings += _apart(products["truth/time"].data, start_time, end, given.poses)
        capture.warnings += writer.losses.warnings()
        writer.annotate(warnings="; ".join(capture.warnings), assumed=", ".join(capture.assumed))
    return output


def _poses(path: Path) -> dict[str, Product]:
    """True poses of a TUM file as data sets of a recording, at their own times."""
    times, poses = read_tum(path)
    return {
        "truth/time": Product(times, "s", f"stamps of the poses of {path.name}"),
        "truth/pose": Product(poses, "m; x y z qx qy qz qw", "sensor in the world"),
    }


def _apart(times: np.ndarray, start: float, end: float, poses: Path) -> list[str]:
    """A warning if no pose falls into the recording: two clocks, most likely."""
    if times[-1] >= start and times[0] <= end:
        return []
    return [
        f"{poses} covers {times[0]:.3f} to {times[-1]:.3f} s, but the frames {start:.3f} to {end:.3f} s: "
        "give start_time to bring both to one clock"
    ]


def _open(source: Path, output: Path, given: Given) -> Capture:
    """Choose the format and the configuration."""
    if not source.is_dir():
        regular(source, _EXPECTED)
    kind = _kind(source)
    if (given.shape or given.variable) and kind != "cube":
        raise InputError(f"{source}: is no array, but shape or variable is given, expected {', '.join(_ARRAYS)}")
    for name in ("latency", "imu_turn"):
        if (value := getattr(given, name)) is not None and kind != "bag":
            raise InputError(f"{source}: is no ROS bag, but {name} is {value}, expected none")
    for name, usual in (("encoding", "signed"), ("layout", "pairs")):
        if (value := getattr(given, name)) != usual and kind not in ("studio", "bin"):
            raise InputError(f"{source}: is no .bin, but {name} is {value}, expected none")
    if kind == "studio":
        return studio_format.open_studio(source, given)
    if kind == "rover":
        return rover_format.open_sequence(source, given)
    beside = bin_format.whole_name(source).with_suffix(".cfg")
    if given.config is None and beside.is_file():
        given = given.or_else(*load_config(beside))
    if kind == "bag":
        from radarize.importers.bag import open_bag

        return open_bag(source, given)
    if kind == "cube":
        return cube_format.open_cube(source, given, folder=output.parent)
    config, assumed = given.configure(str(source))
    if kind == "pcap":
        return pcap_format.open_pcap(source, config, given.cfg_text, assumed)
    read = {"encoding": given.encoding, "layout": given.layout}
    return bin_format.open_bin(bin_format.parts(source), config, given.cfg_text, assumed, **read)


def _kind(source: Path) -> str:
    if source.is_dir():
        if rover_format.is_sequence(source):
            return "rover"
        return "bag" if (source / "metadata.yaml").is_file() else "studio"
    suffix = source.suffix.lower()
    if suffix in _BAGS:
        return "bag"
    if suffix in _ARRAYS:
        return "cube"
    with explained(f"{source}: cannot be read", OSError), source.open("rb") as file:
        magic = file.read(4)
    if magic in (*pcap_format.MAGIC, pcap_format.NEXT_GENERATION) or suffix in (".pcap", ".pcapng"):
        return "pcap"
    if suffix == ".bin":
        configured = bin_format.whole_name(source).with_suffix(".cfg").is_file()
        return "studio" if not configured and studio_format.beside(source) else "bin"
    raise InputError(f"{source}: unknown format, expected {_EXPECTED}")


def _settle_iq_order(capture: Capture, batch: Batch, given: bool) -> tuple[RadarConfig, bool]:
    """The configuration with the I/Q order that the samples show if it is assumed, and whether to swap them.

    Where the configuration says and they contradict it, there is a warning.
    """
    config = capture.config
    decibels = range_balance(batch.frames[:_ASKED])
    other = "iiqq" if config.iq_order == "qqii" else "qqii"
    if given or abs(decibels) < _CERTAIN_DB:
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
