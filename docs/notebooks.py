"""Runs the notebooks in ``notebooks/`` and keeps them with their outputs in ``build/notebooks``.

python -m docs.notebooks               all of them
python -m docs.notebooks --changed     those that have changed since they were last run, as `make docs` does
"""

import os
import sys
import tempfile
import time
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError, CellTimeoutError
from traitlets.config import Config

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
RESULTS = ROOT / "build" / "notebooks"
#: Of a cell, s.
TIMEOUT = 1800


def run(notebook: Path) -> float:
    """Run a notebook in an empty folder of its own, keep it with its outputs, and return the seconds that it took.

    Raises:
        CellExecutionError, CellTimeoutError: a cell failed, or did not end.
    """
    pages = nbformat.read(notebook, as_version=4)
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        # Over sockets in the folder, not over TCP.
        config = Config({"KernelManager": {"transport": "ipc", "ip": f"{folder}/kernel"}})
        where = {"metadata": {"path": folder}}
        NotebookClient(pages, config=config, timeout=TIMEOUT, startup_timeout=TIMEOUT, resources=where).execute()
    RESULTS.mkdir(parents=True, exist_ok=True)
    nbformat.write(pages, RESULTS / notebook.name)
    return time.perf_counter() - start


def is_current(notebook: Path) -> bool:
    """Whether its outputs are newer than the notebook."""
    result = RESULTS / notebook.name
    return result.is_file() and result.stat().st_mtime > notebook.stat().st_mtime


def main() -> int:
    failed = 0
    # The kernel imports this checkout, and finds the commands of its environment.
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
    os.environ["OPEN3D_DISABLE_WEB_VISUALIZER"] = "true"  # which prints lines at import
    os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    chosen = [path for path in NOTEBOOKS if not ("--changed" in sys.argv and is_current(path))]
    for path in chosen:
        try:
            print(f"{path.relative_to(ROOT)}: {run(path):.0f} s", flush=True)
        except (CellExecutionError, CellTimeoutError) as error:
            failed += 1
            print(f"{path.relative_to(ROOT)}: a cell failed\n{error}", file=sys.stderr, flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
