"""Walks of five minutes that come back to where they were: `long_walks.yaml`. Nothing was chosen on them."""

from benchmarks.unseen import judge, parser

PARSER = parser(__doc__, "long_walks")


def main() -> None:
    judge("long_walks", "Walks of five minutes", "To reach: SLAM 0.15 m.", PARSER.parse_args())


if __name__ == "__main__":
    main()
