"""Plug-ins by other packages: shapes, movers, sensors and mechanisms, each in a file of theirs.

A package names its modules in its pyproject.toml, and they are imported when the first scene or sensor is looked up:

    [project.entry-points."radarsim.plugins"]
    rain = "rain.mechanism"

A module of shapes or movers only defines subclasses of `world.description.Shape` or `world.movers.Mover`; one with a
sensor adds it to `sensors.suite.SENSORS`, one with a mechanism to `propagation.finder.MECHANISMS`. Boards are YAML
files that a radar's configuration names by path.
"""

from functools import cache
from importlib.metadata import entry_points

from radarize.io.errors import InputError

GROUP = "radarsim.plugins"


@cache
def load() -> None:
    """Import the modules that installed packages name.

    Raises:
        InputError: one of them cannot be imported.
    """
    for point in entry_points(group=GROUP):
        try:
            point.load()
        except Exception as error:
            raise InputError(f"plug-in {point.name} ({point.value}): cannot be imported ({error})") from error
