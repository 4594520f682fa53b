"""Any benchmark of `radarize benchmark list`, by default the paper's SLAM tables, on the evaluation data set or another
one: its figures among this folder's results."""

import argparse
from pathlib import Path

from benchmarks.evaluation import add_options, compare
from radarize.benchmark.benchmarks import BENCHMARKS


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=("slam", "buildings"), metavar="NAME")
    add_options(parser)
    parser.add_argument("--weights", type=Path, metavar="DIR", help="of the networks; by default the shipped ones")
    parser.add_argument("--out", type=Path, metavar="DIR", help="keep the runs there, and use those that are there")
    options = parser.parse_args()
    for name in options.names:
        if name not in BENCHMARKS:
            parser.error(f"NAME is {name!r}, expected some of: {', '.join(BENCHMARKS)}")
    for name in options.names:
        file = name.replace("-", "_")
        compare(name, file, BENCHMARKS[name].title, options, [], weights=options.weights, script="tables")


if __name__ == "__main__":
    main()
