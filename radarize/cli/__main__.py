"""Run the command line as ``python -m radarize.cli``."""

from radarize.cli import main

main()
