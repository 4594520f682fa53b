"""A recording is one HDF5 file of raw I/Q with the radar's configuration and, where it is known, the truth.

It has one chunk per frame and can be read while it grows:

    /radar          attributes: configuration as JSON, the .cfg text
    /radar/adc      int16 (frame, loop, tx, rx, sample, iq)   absent where only heat maps were kept
    /radar/time     float64 (frame,)                          s, start of the first chirp
    /radar/valid    bool (frame, loop, tx)                    False where samples of the chirp were lost
    /truth/NAME, /imu/NAME, /tracking/NAME, /points/NAME      optional; attributes `unit`, `about`, `clock`, `labels`

``clock`` is the data set with the time or the frame number of each row: ``radar/time`` for one row per frame,
``imu/time`` (s) for a stream at its own rate, ``points/frame`` (frame numbers) for any number of rows per frame. Data
sets without a clock have no time axis.
"""

from radarize.io.recording.captured import spare
from radarize.io.recording.interrupted import keeping
from radarize.io.recording.losses import Losses
from radarize.io.recording.reader import Clip, Recording
from radarize.io.recording.recover import recover
from radarize.io.recording.temporary import in_temporary_file
from radarize.io.recording.writer import Product, RecordingWriter, Stream, add

__all__ = [
    "Clip", "Losses", "Product", "Recording", "RecordingWriter", "Stream", "add", "in_temporary_file", "keeping",
    "recover", "spare",
]  # fmt: skip
