"""Tables in a terminal of 80 columns."""

import json
import os
import signal
import time

import pytest
import trimesh
import typer

import radarize.cli
import radarsim.cli
from radarize.evaluation.report.contents import show
from radarize.io.console import new_app, print_table, progress, run, working
from radarize.io.errors import InputError
from radarsim import doctor

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


def test_a_request_to_terminate_ends_as_ctrl_c_does(capsys, monkeypatch):
    """Signals sent by `kill`, a service manager or a job queue."""
    app, before = new_app("Ends."), signal.getsignal(signal.SIGTERM)
    app.command("wait")(lambda: os.kill(os.getpid(), signal.SIGTERM))
    try:
        with pytest.raises(SystemExit) as exit_:
            run(app, "command", ["wait"])
    finally:
        signal.signal(signal.SIGTERM, before)
    assert exit_.value.code == 2 and "command: stopped; nothing was written" in capsys.readouterr().err


@pytest.fixture
def printed(terminal, capsys):
    """Return the words that a command prints; no line may exceed the terminal."""

    def call(app, *arguments: object) -> list[str]:
        with pytest.raises(SystemExit) as exit_:
            run(app, "command", [*map(str, arguments)])
        out = capsys.readouterr().out
        assert exit_.value.code == 0 and max(map(len, out.splitlines())) <= 80
        return out.split()

    return call


def test_an_imported_part_keeps_its_name_whole(printed, tmp_path, monkeypatch):
    """Names from modelling programs are long, and so are the patterns that select materials."""
    monkeypatch.chdir(tmp_path)
    part, pattern = "Storey2:CupboardDoor:Handle", "Storey2:Cupboard*"
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box((4, 4, 1)), node_name=part)
    scene.export("house.glb")
    (tmp_path / "map.yaml").write_text(f"'{pattern}': metal\n")
    words = printed(radarsim.cli.app, "scene", "import", "house.glb", "-o", "house.yaml", "--materials", "map.yaml")
    assert part in words and {"triangles", "pattern", pattern} <= set(words)


def test_a_scene_and_the_list_of_benchmarks(printed):
    words = printed(radarsim.cli.app, "scene", "info", "office")
    assert {"plasterboard", "triangles", "objects"} <= set(words)
    assert "clutter: 1, unevenness: 1" in " ".join(words) and "bare" not in words
    words = " ".join(printed(radarsim.cli.app, "scene", "info", "physics/room"))
    assert "clutter: 0, unevenness: 0" in words and "`clutter: 1` and `unevenness: 1`" in words
    assert {"odometry-platforms", "(RadarHD's", "repository)."} <= set(printed(radarize.cli.app, "benchmark", "list"))


def test_the_doctor_cuts_no_path(printed, monkeypatch):
    path = "/usr/lib/x86_64-linux-gnu/libLLVM.so.19.1"
    found = [doctor.Finding("LLVM", "ok", f"19, in the folder of the system's own libraries: {path}")]
    monkeypatch.setattr(doctor, "findings", lambda: found)
    assert path in printed(radarsim.cli.app, "doctor")


def test_attributes_written_as_json_break_between_figures(terminal, capsys):
    figures = [round(-1000.25 - k, 2) for k in range(100)]
    found = {"path": "walk.h5", "frames": 0, "duration": 0.0, "lost_chirps": 0, "lost_share": 0.0, "damage": [],
             "effort": "", "config": {}, "derived": {}, "data_sets": {}}  # fmt: skip
    show(found | {"attributes": {"front_end": json.dumps({"dbc_hz": figures}, separators=(",", ":"))}})
    out = capsys.readouterr().out
    assert {f"{figure}," for figure in figures[1:-1]} <= set(out.split()) and max(map(len, out.splitlines())) <= 80


@pytest.mark.parametrize("app", [radarize.cli.app, radarsim.cli.app], ids=["radarize", "radarsim"])
def test_help_cuts_no_word(app, printed):
    """No text is cut, and choices are not broken."""

    def check(command, path: tuple[str, ...]) -> None:
        words = printed(app, *path, "--help")
        cut = [word for word in words if "…" in word or word.startswith("<") and "|" in word and word[-1] != ">"]
        assert not cut, path
        for name, below in getattr(command, "commands", {}).items():
            check(below, (*path, name))

    check(typer.main.get_command(app), ())


def test_progress_without_a_terminal_is_lines(monkeypatch, capsys):
    """Lines at fixed intervals with the latest progress, changed or not; none for quick steps."""
    with progress("simulate") as report:
        report(1, 4)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr("radarize.io.console._PACE", 0.1)
    with progress("train") as report:
        time.sleep(0.15)
        report("reading", 0, 8)
        time.sleep(0.1)
        report("reading", 2, 8)
        time.sleep(0.2)
    first, *_, last = capsys.readouterr().err.splitlines()
    assert first == "train, 0:00:00 so far"
    assert last == "train, reading: 2 of 8 (25%), 0:00:00 so far, 0:00:00 to go"
    with working("evaluating"):
        time.sleep(0.15)
    assert capsys.readouterr().err == "evaluating, 0:00:00 so far\n"
    with pytest.raises(InputError, match="stopped; nothing is lost"), progress("run", "nothing is lost"):
        raise KeyboardInterrupt
