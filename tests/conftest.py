import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

import tests.interruptible  # noqa: F401
from tests import checked
from tests.disk import disk

checked.install()


#: Folders of the longest files. While the first compiles the kernels that all use, the second needs none.
LONGEST = {"documents", "fuzzing", "training", "twin"}


def pytest_runtest_setup():
    checked.begin_test()


def pytest_configure(config):
    """Put temporary files of commands, browsers and clusters into one folder that is removed with the session. Its name
    is short because of sockets; pytest's own folders are not changed."""
    if not hasattr(config, "workerinput"):
        os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", tempfile.gettempdir())
        os.environ["TMPDIR"] = tempfile.tempdir = tempfile.mkdtemp(prefix="rz-")
        config.add_cleanup(lambda: shutil.rmtree(os.environ["TMPDIR"], ignore_errors=True))


def pytest_collection_modifyitems(items):
    """Run the slowest tests first, so that none of them runs alone at the end."""
    items.sort(key=lambda item: LONGEST.isdisjoint(item.path.parts))


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Folder of public recordings beside the repository."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "recordings"
    if not folder.is_dir():
        pytest.skip(f"the public recordings are not at {folder}")
    return folder


@pytest.fixture
def small_disk(tmp_path) -> Iterator[Path]:
    """A file system of 2 MiB."""
    with disk(tmp_path / "disk", 2 << 10) as folder:
        yield folder


@pytest.fixture(scope="module")
def one_thread():
    """Use one thread in torch, as in a worker: for small matrices more threads are slower."""
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="module")
def cluster():
    """Address of a Ray cluster: two nodes of one core each on this machine, with the test's import path."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        patch.setenv("RAY_worker_niceness", "0")  # 15 by default: other tests would not let them work
        patch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
        yield from _two_nodes()


def _two_nodes():
    import ray
    from ray.cluster_utils import Cluster

    nodes = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    nodes.add_node(num_cpus=1)
    yield nodes.address
    ray.shutdown()
    nodes.shutdown()
