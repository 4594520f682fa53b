"""The page of the recording's format, from the sensors' data sets."""

from collections.abc import Iterator

import numpy as np

from docs.reference.markdown import code, docstring, table
from radarize.io import recording
from radarize.io.recording import Product, Stream
from radarize.radar.presets import PRESETS
from radarsim.motion.walk import Walk
from radarsim.scenario import Scenario
from radarsim.sensors.suite import ALWAYS, SENSORS
from radarsim.world.scene import Scene

_HEAD = """
## Attributes

Of the file: `format` (version of the layout), `radarize_version`, `source` (command, or file that was imported),
`warnings`; of a simulation also `radarsim_version`, `engine`, `scene`, `seed`, `platform`, `motion` (statistics as
JSON), `front_end` (settings as JSON) and `processor`. Of the group `/radar`: `config` (the radar's configuration as
JSON) and `cfg` (the original configuration text). Of a data set: `unit`, `about`, `clock` and, where values are
classes, `labels`.

## Data sets of a simulation

Every recording has `/radar`. A simulation also has pose and scan; `--sensors` adds the others. Shapes are those of the
preset `radarize`. `frame` is one row per frame; a stream with a clock of its own has one row per entry of that clock.

"""


def page() -> str:
    """Return the page: layout, attributes, and the data sets of every sensor."""
    about = docstring(recording.__doc__ or "")
    head = "data set", "sensor", "type", "shape", "unit", "what it is"
    return f"# The recording\n\n{about}{_HEAD}{table(head, _rows())}"


def _rows() -> Iterator[tuple[str, ...]]:
    scene = Scene.load("stress/corner")
    scenario = Scenario(scene, Walk(duration=1.0).through(scene, 0), PRESETS["radarize"])
    names = ", ".join(PRESETS["radarize"].frame_shape.__repr__().strip("()").split(", "))
    loops, tx, *_ = PRESETS["radarize"].frame_shape
    yield (
        code("/radar/adc"),
        "",
        "int16",
        f"frame, {names}",
        "ADC counts",
        "loop, transmitter, receiver, sample, I and Q",
    )
    yield code("/radar/time"), "", "float64", "frame", "s", "start of the frame's first chirp"
    yield code("/radar/valid"), "", "bool", f"frame, {loops}, {tx}", "", "False where samples of the chirp were lost"
    for sensor, kind in (ALWAYS | SENSORS).items():
        made = kind(scenario)
        for path, each in (made.streams | made.products).items():
            yield _row(path, "" if sensor in ALWAYS else sensor, each)


def _row(path: str, sensor: str, each: Stream | Product) -> tuple[str, ...]:
    if isinstance(each, Product):
        shape, dtype = each.data.shape, each.data.dtype
    else:
        row = "frame" if each.clock == "radar/time" else f"row of {each.clock}"
        shape, dtype = (row, *each.shape), np.dtype(each.dtype)
    return code(f"/{path}"), code(sensor), str(dtype), ", ".join(map(str, shape)), each.unit, each.about
