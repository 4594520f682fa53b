"""A script writes its results with their provenance to the output folder."""

from benchmarks import motion_statistics
from radarize.evaluation.benchmark.results import Results


def test_a_script_writes_its_part(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["motion_statistics", "--buildings", "1", "--out", str(tmp_path)])
    motion_statistics.main()
    part = Results.read(tmp_path / "motion_statistics.json")
    assert part.tables[0].rows and part.data.walks
    assert part.command == "python -m benchmarks.motion_statistics --buildings 1"
    assert part.markdown() in capsys.readouterr().out
