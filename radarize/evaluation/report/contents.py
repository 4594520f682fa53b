"""Contents of a recording, as plain data and as tables."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from radarize.io.console import print_table, printable
from radarize.io.recording import Recording
from radarize.signal.effort import effort

#: Derived quantities of a configuration, with their units.
DERIVED = {
    "center_frequency": "Hz",
    "wavelength": "m",
    "bandwidth": "Hz",
    "range_resolution": "m",
    "max_range": "m",
    "chirp_time": "s",
    "loop_time": "s",
    "burst_time": "s",
    "burst_center": "s",
    "max_velocity": "m/s",
    "velocity_resolution": "m/s",
    "frame_rate": "Hz",
    "frame_bytes": "B",
}


def contents(path: Path) -> dict[str, Any]:
    """Return everything about a recording except its samples, as JSON-ready data. All samples are unpacked as a check.

    Returns:
        ``path``, ``frames``, ``duration`` (s), ``lost_chirps`` (count) and ``lost_share``, ``damage`` (sentences, see
        `Recording.damage`), ``effort`` (a sentence where frames are much larger than the preset's), ``config``,
        ``derived`` (name to value, units as in `DERIVED`), ``data_sets`` (path to shape, dtype, unit, about),
        ``attributes``.

    Raises:
        InputError: not a recording, or a damaged one.
    """
    with Recording(path) as recording:
        config, times = recording.config, recording.times
        valid = recording.valid(0, len(recording))
        return {
            "path": str(path),
            "frames": len(recording),
            "duration": float(times[-1] - times[0] + config.frame_period) if len(times) else 0.0,
            "start_time": float(times[0]) if len(times) else None,
            "lost_chirps": int(np.size(valid) - np.count_nonzero(valid)),
            "lost_share": float(1 - np.mean(valid)) if np.size(valid) else 0.0,
            "damage": recording.damage,
            "effort": effort(config, len(recording)) if recording.has_samples else "",
            "config": recording.config.model_dump(mode="json"),
            "derived": {name: float(getattr(config, name)) for name in DERIVED},
            "data_sets": {name: _plain(recording.describe(name)) for name in recording.names()},
            "attributes": _plain(recording.attributes),
        }


def _plain(value: object) -> object:
    """Convert to types of JSON."""
    return json.loads(json.dumps(value, default=lambda each: each.tolist() if hasattr(each, "tolist") else str(each)))


def _readable(value: float, unit: str) -> tuple[str, str]:
    """Format a value and its unit with an SI prefix."""
    for prefix, factor in (("G", 1e9), ("M", 1e6), ("k", 1e3), ("", 1.0), ("m", 1e-3), ("u", 1e-6)):
        if abs(value) >= factor * 0.9999:
            return f"{value / factor:.5g}", prefix + unit
    return f"{value:.5g}", unit


def data_sets(found: dict) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return head and rows of the table of data sets, from the result of `contents`."""
    rows: list[tuple[str, ...]] = [
        (f"/{name}", " x ".join(map(str, item["shape"])), item["dtype"], item["unit"], item["about"])
        for name, item in found["data_sets"].items()
    ]
    return ("data set", "shape", "type", "unit", "about"), rows


def _spaced(value: object) -> object:
    """Add a space after each comma of an attribute in JSON, so that a table can break its lines there."""
    return json.dumps(json.loads(value)) if isinstance(value, str) and value.startswith("{") else value


def show(found: dict) -> None:
    """Print the result of `contents`."""
    print(
        f"{printable(found['path'])}: {found['frames']} frames, {found['duration']:.2f} s, "
        f"{found['lost_chirps']} chirps lost ({100 * found['lost_share']:.2f} %)"
    )
    for words in (*found["damage"], found["effort"]):
        if words:
            print(words)
    config = dict(found["config"])
    config["channel_calibration"] = config.get("channel_calibration") or "nominal"
    if isinstance(config.get("board"), dict):
        config["board"] = config["board"]["name"]
    print_table(("configuration", "value"), config.items())
    derived = [(name, *_readable(value, DERIVED[name])) for name, value in found["derived"].items()]
    print_table(("derived", "value", "unit"), derived, numbers=(1,))
    print_table(*data_sets(found))
    print_table(("attribute", "value"), ((name, _spaced(value)) for name, value in found["attributes"].items()))
