"""Recordings of heat maps instead of samples."""

from pathlib import Path

from radarize.io.recording import Product, Recording, RecordingWriter, Stream
from radarize.io.recording.recover import along
from radarize.signal.maps import AZIMUTHS, MAPS, MapMaker

#: Truth as large as samples, which is left out.
_LARGE = ("truth/adc_by_cause",)
_BATCH = 32


def keep_maps(source: Path, output: Path) -> Path:
    """Convert a recording, simulated or real, to one with heat maps instead of samples, about 37 % of the size.

    Truth and other streams are kept, except I/Q by path type.

    Raises:
        InputError: unreadable source, or no space for the output.
    """
    with Recording(source) as recording:
        maker = MapMaker(recording.config)
        streams = {
            f"maps/{name}": Stream(maker.shape(name), "f2", "dB re 1 count^2", MAPS[name]) for name in maker.names
        }
        products = {"maps/azimuths": Product(AZIMUTHS, "rad", "columns of the maps, positive to the left")}
        others = [n for n in recording.names() if not n.startswith(("radar/", "maps/")) and n not in _LARGE]
        streams_along, products_along = along(recording, others)
        streams |= streams_along
        products |= products_along
        own = ("format", "radarize_version")
        attributes = {name: value for name, value in recording.attributes.items() if name not in own}
        with RecordingWriter(
            output, recording.config, cfg_text=recording.cfg_text, attributes=attributes, products=products,
            streams=streams, raw=False,
        ) as writer:  # fmt: skip
            for frames, adc in recording.batches(_BATCH):
                valid = recording.valid(frames.start, frames.stop)
                for name in streams_along:
                    writer.extend(name, recording.rows(name, frames.start, frames.stop))
                rows = {f"maps/{name}": made for name, made in maker(adc, valid).items()}
                writer.append(None, recording.times[frames], valid, rows=rows)
    return output
