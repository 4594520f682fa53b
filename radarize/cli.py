"""`radarize`: the pipeline's command line. `radarize.commands` has the commands."""

from radarize.commands import recordings, runs, studies  # noqa: F401  each enters its commands into `app`
from radarize.commands.app import app
from radarize.console import run


def main() -> None:
    """Entry point of the `radarize` command."""
    run(app, "radarize")


if __name__ == "__main__":
    main()
