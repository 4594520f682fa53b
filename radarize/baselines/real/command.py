"""The command ``radarize benchmark real``."""

from pathlib import Path

import typer

from radarize.baselines.real.real import SHOWN, RealOptions, real
from radarize.evaluation.benchmark.study import OwnBenchmark
from radarize.io.console import print_table, progress
from radarize.io.errors import InputError


def compare(
    data: Path,
    out: Path,
    *,
    weights: Path | None,
    walks: str | None,
    predictions: list[str],
    poses: Path | None,
    workers: int | None,
    ray: str | None,
) -> None:
    """Compare methods on RadarHD's real walks; arguments are the options of the command.

    Raises:
        InputError: an invalid option, or see `real`.
    """
    numbers = [number.strip() for number in walks.split(",")] if walks else []
    if wrong := [number for number in numbers if not number.isdecimal()]:
        raise InputError(f"--walks names {wrong[0]!r}, expected numbers as in 227,230")
    named = dict(each.partition("=")[::2] for each in predictions)
    for name, folder in named.items():
        if not (name and folder and Path(folder).is_dir()):
            raise InputError(f"--predictions is {name}={folder}, expected NAME=FOLDER of a folder that is there")
    others = {name: Path(each) for name, each in named.items()}
    options = RealOptions([int(number) for number in numbers], others, weights, poses, workers, ray)
    with progress("real") as report:
        results = real(data, out, options, progress=report, log=lambda line: typer.echo(line, err=True))
    print_table(*results.tables[0].in_terminal(SHOWN))
    print(out / "real.md")


REAL = OwnBenchmark(
    "Point clouds, changes of yaw and maps on real walks, compared with a lidar (RadarHD's repository).", compare
)
