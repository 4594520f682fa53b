"""Where the `radarsim` command begins."""

from radarize.io.entry import begin


def radarsim() -> None:
    """Entry point of the `radarsim` command."""
    begin("radarsim")
