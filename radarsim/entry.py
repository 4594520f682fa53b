"""Entry point of the `radarsim` command."""

from radarize.io.entry import begin


def radarsim() -> None:
    """Entry point of the `radarsim` command."""
    begin("radarsim")
