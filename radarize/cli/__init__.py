"""`radarize`: the pipeline's command line. `radarize.cli` has the commands."""

from radarize.cli import recordings, runs, studies  # noqa: F401  each enters its commands into `app`
from radarize.cli.app import app
from radarize.io.console import run


def main() -> None:
    """Entry point of the `radarize` command."""
    run(app, "radarize")
