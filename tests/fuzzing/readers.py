"""Every reader of foreign bytes with the inputs to try it on: one definition for the tests and for the long run.

An input must end in a result or an InputError of one line, soon, and without memory that it has not the size for.
"""

from collections.abc import Callable

from tests.fuzzing.captures import arrays, cfg, network_capture, raw_words, studio, tum, udp_packets
from tests.fuzzing.damage import damaged, misspelled
from tests.fuzzing.emulated import board, command_line
from tests.fuzzing.reader import Reader
from tests.fuzzing.recordings import bags, recording
from tests.fuzzing.runs import log, run_file, run_scans, sound_run, weights
from tests.fuzzing.worlds import WORLDS

#: By name, in the order of the table; making one writes its valid files.
READERS: dict[str, Callable[[], Reader]] = {
    "SDK .cfg": cfg,
    "mmWave Studio JSON": studio,
    "TUM poses": tum,
    "UDP packets": udp_packets,
    "pcap": network_capture,
    ".bin": raw_words,
    "npy": lambda: arrays("npy"),
    "npz": lambda: arrays("npz"),
    "mat": lambda: arrays("mat"),
    "HDF5 recording": recording,
    "ROS 1 bag": lambda: bags("bag"),
    "ROS 2 mcap": lambda: bags("mcap"),
    "ROS 2 db3": lambda: bags("db3"),
    "run: scans.h5": run_scans,
    "run: run.json": lambda: run_file("run.json", misspelled([sound_run()["run.json"].decode()])),
    "run: metrics.json": lambda: run_file("metrics.json", misspelled([sound_run()["metrics.json"].decode()])),
    "run: map.yaml": lambda: run_file("map.yaml", misspelled([sound_run()["map.yaml"].decode()])),
    "run: map.pgm": lambda: run_file("map.pgm", damaged([sound_run()["map.pgm"]])),
    "run: trajectory.tum": lambda: run_file("trajectory.tum", misspelled([sound_run()["trajectory.tum"].decode()])),
    "scans .npz": log,
    "weights": weights,
    "emulator: command line": command_line,
    "emulator: board": board,
    **WORLDS,
}
