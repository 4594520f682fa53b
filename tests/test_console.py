"""Tables in a terminal of 80 columns."""

import pytest

from radarize.console import print_table

METHODS = ("scan-matching + segmentation", "published + published", "doppler + radarhd")


@pytest.fixture
def terminal(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")


def test_a_wide_table_fits_and_cuts_no_word(terminal, capsys):
    head = ("method", *(f"{which} {what} over a second, {unit}" for which in ("odometry", "SLAM") for what, unit in (
        ("ATE", "m"), ("ATE", "rad"), ("RE", "m"))))  # fmt: skip
    print_table(head, [(name, *["0.00571"] * 6) for name in METHODS], numbers=range(1, 7))
    out = capsys.readouterr().out
    assert max(map(len, out.splitlines())) <= 80
    shown = out.split()
    for word in " ".join((*head, *METHODS)).split():
        assert word in shown
    assert shown.count("0.00571") == 18


def test_long_text_takes_the_room_that_is_left(terminal, capsys):
    about = "strongest cause of a range-azimuth cell: " + "0 direct, 1 floor_ceiling, 2 ghost_1, " * 4
    print_table(("data set", "shape", "about"), [("/truth/occupancy_azimuths", "600 x 96 x 88", about)])
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    assert "/truth/occupancy_azimuths" in lines[2] and len(lines) < 10
    assert all(word in " ".join(lines).split() for word in about.split())


def test_what_is_longer_than_a_line_is_broken(terminal, capsys):
    print_table(("attribute", "value"), [("front_end", "x" * 300)])
    out = capsys.readouterr().out
    assert out.count("x") == 300 and max(map(len, out.splitlines())) <= 80


def test_an_empty_table_is_its_head(terminal, capsys):
    print_table(("attribute", "value"), [])
    assert capsys.readouterr().out.split()[:2] == ["attribute", "value"]
