"""Jobs on a real Ray cluster with the same call, and the steps of a comparison on it."""

from pathlib import Path

import pytest

from radarize.evaluation.benchmark.steps import perform as do_steps
from radarize.io.errors import InputError
from radarize.io.jobs import News, perform
from tests.evaluation.benchmark.test_steps import Note, log
from tests.io.jobs.work import Fall, Threads, Wait, refuse


def test_jobs_end_as_they_do_here(cluster, tmp_path, monkeypatch):
    """Relative paths refer to the folder in which the program runs."""
    monkeypatch.chdir(tmp_path)
    Path("fall").mkdir()
    jobs = {"a": Wait(Path("go")), "b": refuse, "c": Fall(Path("fall"), 1), "d": Threads(early=False)}
    found = {}
    for news in perform(jobs, ray=cluster):
        if news == News("a", 0.5):
            Path("go").touch()
        elif news.ended:
            found[news.name] = news
    assert len(found) == 4
    assert found["a"].result == str(tmp_path) and Path("go").exists()
    assert found["b"].error == "a.h5: is not there"
    assert found["c"].result == "stands" and len(list(Path("fall").iterdir())) == 2
    assert found["d"].result == {"numba": 1, "asked of numba": 1, "torch": 1, "blas": 1}


def test_steps_are_done_on_nodes(cluster, tmp_path):
    (tmp_path / "notes").mkdir()
    steps = [Note("t", alone=True), Note("a"), Note("b1"), Note("b2")]
    steps.append(Note("c", trouble="no"))
    moved = []
    found = do_steps(steps, tmp_path, 1, lambda *where: moved.append(where), ray=cluster)
    assert found == {step: step.trouble or {"pair": [step.name, 0]} for step in steps}
    assert [len(log(step, tmp_path)) for step in steps] == [1, 1, 1, 1, 0]
    assert moved[0] == (0, 50) and moved[-1] == (50, 50)
    assert do_steps(steps, tmp_path, 1, lambda *where: None) == found  # kept


def test_a_cluster_that_is_not_there_is_named():
    with pytest.raises(InputError, match="--ray 127.0.0.1:9: no cluster answers"):
        next(perform({"a": refuse}, ray="127.0.0.1:9"))
