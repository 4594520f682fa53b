"""Walks of five minutes that come back to where they were: `long_walks.yaml`. Nothing was chosen on them."""

import argparse

from benchmarks.results import script
from benchmarks.unseen import judge, options_of


@script("Walks of five minutes", **options_of("long_walks"))
def main(options: argparse.Namespace) -> None:
    judge("To reach: SLAM 0.15 m.", "Walks of five minutes", "long_walks", options)
