"""Export of a recording as a sequence in roverd's layout, described in `radarize.io.importers.rover`: the format of the
data set I/Q-1M, on which nrdk trains.

    SEQUENCE/config.yaml         chirps, in GHz, MHz/us, us, ksps and ms
             radar/meta.json     type and shape of each channel        radar/radar.json  resolutions, order of chirps
             radar/iq, ts, valid words Q Q I I; stamps, s; 0 of frames that lost packets
             _radar/pose.npz     true poses: t (s), pos (m), rot (matrices), vel (m/s) and acc (m/s^2) in the world

Transmitters are in the order TX1, TX2, TX3, from which xwr and nrdk place the antennas, independent of the firing
order, which is stored in radar.json as ``tx_order``.
"""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import yaml
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.io.replacing import new_folder
from radarize.radar.boards import load_board
from radarize.radar.config import RadarConfig, fired, firing_name
from radarize.radar.dca1000 import encode

#: Firing transmitters of the rigs; with two, the elevated one in the middle of the row is left out.
_TRANSMITTERS = ((0,), (0, 2), (0, 1, 2))
_BATCH_BYTES = 16 << 20
_CHANNELS = {
    "iq": ("i2", "Raw I/Q stream."),
    "ts": ("f8", "Timestamp, in seconds: start of the frame's first chirp."),
    "valid": ("u1", "True if this frame is complete."),
}


def export_roverd(source: Path, output: Path, *, progress: Callable[[int, int], None]) -> Path:
    """Write a recording as a roverd sequence; see `exporters.export`.

    Raises:
        InputError: not a recording, transmitters that no rig has, or the folder exists.
    """
    with Recording(source) as recording, new_folder(output, "sequence") as folder:
        config = recording.config
        if config.tx not in _TRANSMITTERS:
            names = ", ".join(map(firing_name, config.tx))
            raise InputError(f"{source}: has {names}, expected TX1, TX1 and TX3, or all three, as the format has them")
        physical = config.model_copy(update={"tx_order": config.tx, "iq_order": "qqii"})
        sensor = folder / "radar"
        sensor.mkdir(parents=True)
        loops, tx, rx, samples, _ = config.frame_shape
        shapes = {"iq": [loops, tx, rx, 2 * samples], "ts": [], "valid": []}
        about = {
            name: {"format": "raw", "type": kind, "shape": shapes[name], "desc": text}
            for name, (kind, text) in _CHANNELS.items()
        }
        (sensor / "meta.json").write_text(json.dumps(about, indent=4))
        (sensor / "radar.json").write_text(json.dumps(_resolutions(config), indent=4))
        settings = {"radar": {"type": "radar", "args": {"radar": _chirps(config)}}}
        (folder / "config.yaml").write_text(yaml.safe_dump(settings, sort_keys=False))
        recording.times.astype("<f8").tofile(sensor / "ts")
        with (sensor / "iq").open("wb") as words, (sensor / "valid").open("wb") as valid:
            for frames, adc in recording.batches(max(1, _BATCH_BYTES // config.frame_bytes)):
                words.write(encode(adc, physical).astype("<i2", copy=False).data)
                whole = recording.valid(frames.start, frames.stop).all(axis=(1, 2))
                valid.write(whole.astype(np.uint8).data)
                progress(frames.stop, len(recording))
        if (poses := _poses(recording)) is not None:
            (folder / "_radar").mkdir()
            np.savez(folder / "_radar" / "pose.npz", **poses)  # type: ignore[arg-type]
    return output


def _resolutions(config: RadarConfig) -> dict[str, object]:
    loops, tx, rx, samples, _ = config.frame_shape
    return {
        "shape": [loops, tx, rx, samples],
        "range_resolution": config.range_resolution,
        "doppler_resolution": config.velocity_resolution,
        "tx_order": [fired(tx)[0] + 1 for tx in config.tx_order],
    }


def _chirps(config: RadarConfig) -> dict[str, object]:
    """Return the chirp parameters as the rig's program stores them."""
    return {
        "device": load_board(config.board).chip.upper().replace("IWR", "AWR"),
        "frequency": _round(config.start_frequency / 1e9),
        "idle_time": _round(config.idle_time * 1e6),
        "adc_start_time": _round(config.adc_start_time * 1e6),
        "ramp_end_time": _round(config.ramp_end_time * 1e6),
        "tx_start_time": 1.0,
        "freq_slope": _round(config.slope / 1e12),
        "adc_samples": config.samples,
        "sample_rate": _round(config.sample_rate / 1e3),
        "frame_length": config.loops,
        "frame_period": _round(config.frame_period * 1e3),
    }


def _round(value: float) -> float:
    """Remove rounding errors of a change of units: 20.0, not 19.999999999999996."""
    return float(f"{value:.12g}")


def _poses(recording: Recording) -> dict[str, Float[np.ndarray, "pose ..."]] | None:
    """Return true poses, with velocities and accelerations in the world; None without truth."""
    truth = recording.true_poses()
    if truth is None or len(truth[0]) < 2:
        return None
    times, poses = truth
    turn = Rotation.from_quat(poses[:, 3:])
    velocity = np.gradient(poses[:, :3], times, axis=0)
    if recording.has("truth/velocity") and len(own := recording.read("truth/velocity")) == len(times):
        velocity = turn.apply(own[:, :3])
    acceleration = np.gradient(velocity, times, axis=0)
    return {"t": times, "pos": poses[:, :3], "rot": turn.as_matrix(), "vel": velocity, "acc": acceleration}
