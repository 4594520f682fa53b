"""Scans by every method and SLAM's maps in buildings that no training saw: `radarize benchmark mapping` on the
evaluation data."""

import argparse
from pathlib import Path

from benchmarks.evaluation import add_options, compare
from radarize.methods.registry import SCANS


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add_options(parser)
    parser.add_argument("--methods", nargs="+", choices=SCANS, default=())
    parser.add_argument("--weights", type=Path, metavar="DIR", help="of the networks; by default the shipped ones")
    parser.add_argument("--out", type=Path, metavar="DIR", help="keep the runs there, and use those that are there")
    options = parser.parse_args()
    compare(
        "mapping",
        "mapping",
        "Scans and maps in buildings that no training saw",
        options,
        ["To reach: 85 % within 10 cm, less than 1 % through a wall, less than 3 % ghosts left."],
        methods=options.methods,
        weights=options.weights,
    )


if __name__ == "__main__":
    main()
