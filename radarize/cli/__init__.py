"""Command line `radarize`: importing this package registers all commands in `app`."""

from radarize.cli import recordings, runs, studies  # noqa: F401  each registers its commands in `app`
from radarize.cli.app import app
from radarize.io.console import run


def main() -> None:
    """Entry point of the `radarize` command."""
    run(app, "radarize")
