"""Entry points of the commands; importing takes a moment, in which Ctrl-C also ends with one sentence."""

import sys
from importlib import import_module


def begin(name: str) -> None:
    """Run the command line of a package and exit."""
    try:
        commands = import_module(f"{name}.cli")
    except KeyboardInterrupt:
        print(f"\n{name}: stopped; nothing was written", file=sys.stderr)
        sys.exit(2)
    commands.main()


def radarize() -> None:
    """Entry point of the `radarize` command."""
    begin("radarize")
