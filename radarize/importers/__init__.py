"""Recordings from foreign files, one module per format.

A format opens its files as a `Capture`: words as the radar sent them, in batches of whole frames. What follows is the
same for all: sort the samples, stamp the frames, write the recording.
"""

from collections.abc import Callable
from itertools import chain
from pathlib import Path

import numpy as np

from radarize.errors import InputError
from radarize.importers import bin as bin_format
from radarize.importers import pcap as pcap_format
from radarize.importers import studio as studio_format
from radarize.importers.capture import Capture
from radarize.importers.parameters import configure
from radarize.importers.poses import pose_products
from radarize.radar import dca1000
from radarize.radar.cfg import load_config
from radarize.radar.config import RadarConfig
from radarize.recording import RecordingWriter

#: From this many dB on, the samples themselves say which of I and Q comes first.
_CERTAIN_DB = 10.0


def import_recording(
    source: Path,
    output: Path,
    *,
    config: RadarConfig | None = None,
    cfg_text: str = "",
    poses: Path | None = None,
    overrides: dict[str, object] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Write a recording (.h5) from a capture.

    Frames are stamped ``start_time + index * frame_period``. What the user should know (a truncated last frame, lost
    packets, doubtful settings) is joined in the recording's attribute ``warnings``; settings that nobody gave are
    named in ``assumed``.

    Args:
        source: a DCA1000 ``.bin`` (its ``.cfg`` of the same name, or mmWave Studio's JSON files, may lie beside it), a
            ``.pcap`` of its UDP stream, or a folder of mmWave Studio files.
        output: recording to write.
        config: radar configuration; by default what lies beside the source.
        cfg_text: text that `config` was read from, kept in the recording.
        poses: TUM file of the sensor's true poses on the recording's clock.
        overrides: fields of `RadarConfig` that replace or stand in for the configuration's; ``rx`` and ``tx`` may be
            counts; ``start_time`` is the first frame's stamp, s.
        progress: called with frames done and (estimated) frames in all.

    Returns:
        `output`.

    Raises:
        InputError: unknown format, nothing usable in the source, or a configuration that does not fit it.
    """
    source, output = Path(source), Path(output)
    overrides = dict(overrides or {})
    start_time = float(overrides.pop("start_time", 0.0))
    if source.resolve() == output.resolve():
        raise InputError(f"{output}: is the source itself, expected another output file")
    products = pose_products(Path(poses)) if poses else {}

    capture = _open(source, config, cfg_text, overrides)
    batches = iter(capture.batches)
    first = next(batches)
    radar = _settle_iq_order(capture, first[0], "iq_order" in overrides)
    writer = RecordingWriter(
        output,
        radar,
        cfg_text=capture.cfg_text,
        attributes={"source": source.name, **capture.attributes},
        products=products,
    )
    done = 0
    with writer:
        for words, valid in chain([first], batches):
            stamps = start_time + radar.frame_period * np.arange(done, done + len(valid))
            writer.append(dca1000.decode(words, radar), stamps, valid)
            done += len(valid)
            if progress:
                progress(done, max(done, capture.expected_frames))
        if products:
            capture.warnings += _apart(products["truth/time"].data, start_time, done * radar.frame_period, Path(poses))
        capture.warnings += writer.losses.warnings()
        writer.annotate(warnings="; ".join(capture.warnings), assumed=", ".join(capture.assumed))
    return output


def _apart(times: np.ndarray, start: float, duration: float, poses: Path) -> list[str]:
    """A warning if no pose falls into the recording: two clocks, most likely."""
    if times[-1] >= start and times[0] <= start + duration:
        return []
    return [
        f"{poses} covers {times[0]:.3f} to {times[-1]:.3f} s, but the frames {start:.3f} to {start + duration:.3f} s: "
        "give start_time to bring both to one clock"
    ]


def _open(source: Path, config: RadarConfig | None, cfg_text: str, overrides: dict[str, object]) -> Capture:
    """Choose the format and the configuration."""
    if not source.exists():
        raise InputError(f"{source}: no such file or folder, expected a .bin, a .pcap or a mmWave Studio folder")
    kind = _kind(source)
    if kind == "studio":
        studio = studio_format.find(source)
        if config is None:
            config, cfg_text = studio.config, studio.text
        config, _ = configure(config, overrides, str(studio.settings))
        return bin_format.open_bin(studio.files, config, cfg_text, warnings=studio.warnings)
    beside = source.with_suffix(".cfg")
    if config is None and beside.is_file():
        config, cfg_text = load_config(beside)
    config, assumed = configure(config, overrides, str(source))
    if kind == "pcap":
        return pcap_format.open_pcap(source, config, cfg_text, assumed)
    return bin_format.open_bin((source,), config, cfg_text, assumed)


def _kind(source: Path) -> str:
    if source.is_dir():
        return "studio"
    try:
        with source.open("rb") as file:
            magic = file.read(4)
    except OSError as error:
        raise InputError(f"{source}: cannot be read ({error.strerror})") from error
    if magic in pcap_format.MAGIC or source.suffix.lower() in (".pcap", ".pcapng"):
        return "pcap"
    if source.suffix.lower() == ".bin":
        return "studio" if not source.with_suffix(".cfg").is_file() and studio_format.beside(source) else "bin"
    raise InputError(f"{source}: unknown format, expected a DCA1000 .bin, a .pcap or a folder of mmWave Studio files")


def _settle_iq_order(capture: Capture, words: np.ndarray, given: bool) -> RadarConfig:
    """The configuration with the I/Q order found from the samples if it is assumed; a warning if they contradict it."""
    config = capture.config
    found, decibels = dca1000.detect_iq_order(words[: 8 * config.frame_bytes // 2], config)
    if decibels < _CERTAIN_DB or found == config.iq_order or given:
        return config
    if "iq_order" in capture.assumed:
        return config.model_copy(update={"iq_order": found})
    capture.warnings.append(
        f"iq_order is {config.iq_order} in the configuration, but the samples look like {found} "
        f"({decibels:.0f} dB more energy at near range)"
    )
    return config
