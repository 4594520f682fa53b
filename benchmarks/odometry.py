"""Odometry by every method in buildings that no training saw: `radarize benchmark odometry` on the evaluation data."""

import argparse
from pathlib import Path

from benchmarks.evaluation import add_options, compare
from radarize.methods.registry import ODOMETRY

#: Mean ATE in m and rad that our odometry is to reach: half of the paper's.
TARGET = {"odometry": (0.40, 0.18), "odometry-platforms": (0.56, 0.28)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add_options(parser)
    parser.add_argument("--methods", nargs="+", choices=ODOMETRY, default=())
    parser.add_argument("--out", type=Path, metavar="DIR", help="keep the runs there, and use those that are there")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--weights", type=Path, metavar="DIR", help="of the networks; by default the shipped ones")
    which.add_argument(
        "--platform-weights", type=Path, metavar="DIR", help="trained by hand only: tested on cart and robot"
    )
    options = parser.parse_args()
    name = "odometry-platforms" if options.platform_weights else "odometry"
    title = "Odometry in buildings that no training saw"
    position, rotation = TARGET[name]
    compare(
        name,
        "odometry_platforms" if options.platform_weights else "odometry",
        title + (", networks trained by hand only" if options.platform_weights else ""),
        options,
        [
            f"To reach: ATE {position} m and {rotation} rad, velocity RMSE 0.05 m/s, yaw over 0.27 s 1 deg, NEES 0.8 "
            "to 1.25. The paper's figures are of real recordings of its own buildings."
        ],
        script="odometry",
        methods=options.methods,
        weights=options.platform_weights or options.weights,
    )


if __name__ == "__main__":
    main()
