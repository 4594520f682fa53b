"""Export to common file formats: raw samples as from an IWR1843 with a DCA1000 (``NAME.bin`` and ``NAME.cfg``),
trajectories as TUM files, maps for ROS's map_server."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.io.replacing import replacing
from radarize.io.tum import write_tum
from radarize.pipeline.runfolder import RunFolder
from radarize.radar.cfg import cfg_headers, parse_cfg, write_cfg
from radarize.radar.dca1000 import encode

_BATCH_BYTES = 16 << 20


def export_bin(
    source: Path, output: Path, *, iq_order: str | None = None, progress: Callable[[int, int], None]
) -> Path:
    """Write a recording's samples as ``.bin`` and ``.cfg``, with the stem of `output`.

    Words are in groups of four, ``Q0 Q1 I0 I1`` (``qqii``) or ``I0 I1 Q0 Q1`` (``iiqq``); the third number of
    ``adcbufCfg`` is 1 or 0 accordingly.

    Raises:
        InputError: not a recording, an unknown order, or a file cannot be written.
    """
    with Recording(source) as recording:
        config = recording.config if iq_order is None else recording.config.changed("--iq-order", iq_order=iq_order)
        # A suffix such as .v2 belongs to the name.
        stem = output.with_suffix("") if output.suffix in (".bin", ".cfg") else output
        binary, settings = stem.with_name(stem.name + ".bin"), stem.with_name(stem.name + ".cfg")
        text = write_cfg(config)
        with suppress(InputError):
            if recording.cfg_text and parse_cfg(recording.cfg_text) == config:
                lacking = [line for line in cfg_headers(config) if line.split(":")[0] not in recording.cfg_text]
                text = "\n".join(
                    [*lacking, recording.cfg_text]
                )  # the original text, with its comments, if it is equivalent

        with replacing(settings) as part:
            part.write_bytes(text.encode())
        with replacing(binary) as part, part.open("wb") as file:
            for frames, adc in recording.batches(max(1, _BATCH_BYTES // config.frame_bytes)):
                file.write(encode(adc, config).astype("<i2", copy=False).data)
                progress(frames.stop, len(recording))
    return binary


def export_tum(source: Path, output: Path, *, progress: Callable[[int, int], None]) -> Path:
    """Write the trajectory of a run, or the known true poses of a recording, as a TUM file.

    Raises:
        InputError: there is none, or the file cannot be written.
    """
    if source.is_dir():
        return write_tum(output, *RunFolder(source).trajectory)
    with Recording(source) as recording:
        if (truth := recording.true_poses()) is None:
            raise InputError(f"{source}: has no true poses (/truth/time and /truth/pose) to write as TUM")
    return write_tum(output, *truth)


def export_map(source: Path, output: Path, *, progress: Callable[[int, int], None]) -> Path:
    """Write the map of a run as ``NAME.pgm`` and ``NAME.yaml``.

    Raises:
        InputError: `source` is no run with a map, or a file cannot be written.
    """
    if not source.is_dir():
        raise InputError(f"{source}: has no map, expected the folder of a run (radarize run {source} -o RUN)")
    found = RunFolder(source).map
    if found is None:
        raise InputError(f"{source}: has no map.yaml, expected a folder that radarize run wrote")
    stem = output.with_suffix("") if output.suffix in (".pgm", ".yaml") else output
    return found.save(stem.with_name(stem.name + ".yaml"))
