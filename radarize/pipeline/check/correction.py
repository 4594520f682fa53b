"""Write corrected recordings and board files."""

from pathlib import Path

import numpy as np
import yaml

from radarize.io.errors import InputError
from radarize.io.recording import Clip, RecordingWriter
from radarize.io.recording.recover import along
from radarize.io.replacing import write_whole
from radarize.pipeline.check.evidence import Evidence
from radarize.pipeline.check.finding import Finding
from radarize.radar.boards import SUFFIXES, load_board
from radarize.radar.cfg import write_cfg

#: Frames written at a time.
_BATCH = 16


def write_corrected(frames: Clip, findings: tuple[Finding, ...], output: Path) -> Path:
    """Write a recording in which everything is corrected that can be; or, to a ``.yaml``, the correct board.

    Args:
        frames: frames of the recording.
        findings: findings of its check.
        output: file to write.

    Raises:
        InputError: nothing can be corrected, or `output` cannot be written.
    """
    corrected = [each for each in findings if each.correction is not None]
    path = frames.recording.path
    if not corrected:
        found = ", ".join(each.kind for each in findings) or "no fault"
        raise InputError(f"{path}: --fix is given, but {found} was found, expected a fault that it can correct")
    evidence = Evidence.of(frames)
    for each in corrected:
        assert each.correction is not None
        evidence = evidence.corrected(each.correction)
    if output.suffix in SUFFIXES:
        return _write_board(frames, evidence, output)
    if output.exists() and output.samefile(path):
        raise InputError(f"{output}: is the input recording, expected another file")
    return _write_recording(frames, evidence, output, [each.kind for each in corrected])


def _write_board(frames: Clip, evidence: Evidence, output: Path) -> Path:
    board = load_board(evidence.config.board)
    if board == load_board(frames.config.board):
        raise InputError(f"{output}: the board is correct, expected a recording (.h5) to write")
    fields = board.model_dump(mode="json", exclude={"name"})
    return write_whole(output, yaml.safe_dump(fields, sort_keys=False, default_flow_style=None))


def _write_recording(frames: Clip, evidence: Evidence, output: Path, kinds: list[str]) -> Path:
    source, config = frames.recording, evidence.config
    streams, products = along(source, [name for name in source.names() if not name.startswith("radar/")])
    if len(evidence.numbers) != len(source) or (np.diff(evidence.numbers) != 1).any():
        # Rows that refer to frame numbers would refer to other frames.
        streams = {name: each for name, each in streams.items() if not each.clock.startswith("points/")}
    attributes = {k: v for k, v in source.attributes.items() if k not in ("format", "radarize_version")}
    before = [str(attributes[name]) for name in ("warnings",) if attributes.get(name)]
    attributes["warnings"] = "; ".join([*before, f"corrected by radarize check: {', '.join(kinds)}"])
    with RecordingWriter(
        output, config, cfg_text=source.cfg_text if config == source.config else write_cfg(config),
        attributes=attributes, streams=streams, products=products,
    ) as writer:  # fmt: skip
        for start in range(0, len(evidence), _BATCH):
            part = slice(start, min(start + _BATCH, len(evidence)))
            rows = {
                name: np.concatenate([source.rows(name, k, k + 1) for k in evidence.numbers[part]])
                for name, each in streams.items()
                if each.clock == "radar/time"
            }
            # Times of rows that belong to frames move with the stamps of the frames.
            later = evidence.times[part] - source.times[evidence.numbers[part]]
            rows |= {name: data + later for name, data in rows.items() if name.endswith("/time")}
            adc = evidence.read(part.start, part.stop)
            writer.append(adc, evidence.times[part], evidence.valid[part], rows=rows)
        for name, each in streams.items():
            if each.clock != "radar/time":
                writer.extend(name, source.read(name))
    return output
