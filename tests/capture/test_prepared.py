"""After preparation of `live`, SLAM compiles nothing. In a separate process, because other tests compile, too."""

import subprocess
import sys

SCRIPT = """
import sys

import numpy as np

from radarize.capture.live import prepare
from radarize.pipeline.method import Inputs
from radarize.pipeline.methods import CLASSICAL
from radarize.radar.presets import PRESETS
from radarize.slam.backend import Slam
from radarize.slam.config import SlamConfig
from tests.slam.world import play, ring, walk


def compiled():
    kernels = [value for name, module in sorted(sys.modules.items()) if name.startswith("radarize.slam")
               for value in vars(module).values() if hasattr(value, "py_func")]
    return [(kernel.__name__, str(signature)) for kernel in kernels for signature in kernel.signatures]


prepare(Inputs(PRESETS["radarize"]), CLASSICAL)
before = compiled()
slam = Slam(SlamConfig.preset("radar"), endless=True)
play(slam, ring(), walk([[1.5, 1.5], [10.5, 1.5], [1.5, 1.5]], 0.1, 0.15), np.random.default_rng(0))
slam.finish()
assert len(slam.graph.closures) > 0
print(set(compiled()) - set(before))
"""


def test_nothing_is_left_to_compile():
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True)
    assert (done.stdout, done.returncode) == ("set()\n", 0), done.stderr
