"""Jobs in local processes: results, error sentences, killed workers, interrupts, threads."""

import multiprocessing
import os
import signal
import time
from pathlib import Path

import pytest

from radarize.io.jobs import News, perform
from tests.io.jobs.work import Fall, Sleep, Threads, refuse, stumble

CORES = len(os.sched_getaffinity(0))


def ends(news) -> dict[str, object]:
    """Return results or error sentences by name."""
    return {each.name: each.result if each.error is None else each.error for each in news if each.ended}


def test_jobs_end_with_a_result_or_a_sentence(tmp_path):
    heard = list(perform({"a": Sleep(tmp_path / "a", 0.0), "b": refuse, "c": stumble}, workers=2))
    found = ends(heard)
    assert found["a"] == int((tmp_path / "a").read_text()) != os.getpid()
    assert found["b"] == "a.h5: is not there"
    assert found["c"] == "c: internal error, ZeroDivisionError: odd"
    assert News("a", 0.5) in heard
    assert list(perform({})) == []


def test_a_job_is_begun_again_once(tmp_path):
    (tmp_path / "once").mkdir(), (tmp_path / "always").mkdir()
    found = ends(perform({"once": Fall(tmp_path / "once", 1), "always": Fall(tmp_path / "always", 9)}, workers=1))
    assert found["once"] == "stands"
    assert found["always"].startswith("always: its process was killed twice; usually memory is short")
    assert len(list((tmp_path / "always").iterdir())) == 2


def test_a_worker_that_dies_at_rest_is_replaced(tmp_path):
    """A worker is killed between two jobs, as by the system when memory is short."""
    found = {}
    for news in perform({name: Sleep(tmp_path / name, 0.0) for name in "ab"}, workers=1):
        if news.ended:
            found[news.name] = news
        if news.ended and news.name == "a":
            os.kill(found["a"].result, signal.SIGKILL)
            while Path(f"/proc/{found['a'].result}/stat").read_text().split()[2] != "Z":
                time.sleep(0.01)
    assert found["b"].error is None and found["b"].result != found["a"].result


def test_an_interrupt_ends_the_workers_and_no_other_child(tmp_path):
    """Other child processes of the program, such as those of a live page or a reader, are not ended."""
    other = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(600,), daemon=True)
    other.start()
    try:
        jobs = {name: Sleep(tmp_path / name) for name in "ab"}
        with pytest.raises(KeyboardInterrupt):
            for _ in perform(jobs, workers=2):
                if all((tmp_path / name).exists() for name in "ab"):
                    raise KeyboardInterrupt
        workers = [int((tmp_path / name).read_text()) for name in "ab"]
        assert not any(Path(f"/proc/{worker}").exists() for worker in workers)
        assert other.is_alive()
    finally:
        other.kill()


@pytest.mark.skipif(CORES < 2, reason="one core has one share")
@pytest.mark.parametrize("job", [Threads(early=True), Threads(early=False)], ids=["before", "after"])
def test_each_worker_has_its_share_of_the_cores(job, monkeypatch, tmp_path):
    """Numbers of threads that really run, in a kernel compiled late, and in libraries loaded before or after."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)
    found = ends(perform(dict.fromkeys(map(str, range(CORES)), job), workers=CORES))
    for threads in found.values():
        assert threads == {"numba": 1, "asked of numba": 1, "torch": 1, "blas": 1}


def test_a_job_alone_has_all_cores(tmp_path):
    (found,) = ends(perform({"one": Threads(early=True)}, workers=7, alone=True)).values()
    assert found["asked of numba"] == found["torch"] == CORES
