"""Runs command lines for a test: each as its console script would, in a fork of this process, which has the large
libraries loaded. That saves the seconds that eighty commands would take to import them.

Reads lines of JSON: the words of a command, its folder, and the log that it writes to; answers with its exit code and
what processor time it took, s.
"""

import importlib
import json
import os
import runpy
import subprocess
import sys

#: What takes long to import, and starts no threads, which a fork would lack.
LIBRARIES = (
    *("torch", "numba", "h5py", "scipy.interpolate", "scipy.signal", "scipy.optimize", "scipy.ndimage", "psutil"),
    *("matplotlib.pyplot", "plotly.graph_objects", "pydantic", "shapely", "trimesh", "rich.progress", "gtsam"),
)
CONSOLE_SCRIPTS = {"radarize": "radarize.cli", "radarsim": "radarsim.cli"}


def main() -> None:
    for name in (*LIBRARIES, *CONSOLE_SCRIPTS.values()):
        importlib.import_module(name)
    for line in iter(sys.stdin.readline, ""):
        order = json.loads(line)
        child = os.fork()
        if not child:
            return do(**order)
        _, status, used = os.wait4(child, 0)
        print(os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime, flush=True)


def do(words: list[str], folder: str, log: str) -> None:
    os.chdir(folder)
    for target, file, flags in ((0, os.devnull, os.O_RDONLY), (1, log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)):
        os.dup2(os.open(file, flags), target)
    os.dup2(1, 2)
    sys.argv = words
    if words[0] in CONSOLE_SCRIPTS:
        importlib.import_module(CONSOLE_SCRIPTS[words[0]]).main()
    elif words[0] == "python":
        sys.path.insert(0, folder)
        sys.argv = words[1:]
        # By its whole path: processes that are spawned look for it where this one was begun.
        runpy.run_path(os.path.join(folder, words[1]), run_name="__main__")
    else:
        sys.exit(subprocess.call([os.path.join(os.path.dirname(sys.executable), words[0]), *words[1:]]))


if __name__ == "__main__":
    main()
