"""Before any test: what numba compiles is compiled, or loaded if it is that of these sources, so that no test is timed with the compiler.

With pytest-xdist its controller does so before it starts its workers, which then load. Hypothesis draws the same examples in every run.
"""

from __future__ import annotations

import os
import subprocess
import sys

from hypothesis import HealthCheck, settings

from env_server import touch
from shape_server.paths import compile_kernels

if "PYTEST_XDIST_WORKER" not in os.environ:
    with subprocess.Popen([sys.executable, "-m", "shape_server", "--warm-up"], stdout=subprocess.DEVNULL) as beside:
        touch.warm_up()
    if beside.returncode:
        raise RuntimeError("the kernels of the shape server do not compile; see: python -m shape_server --warm-up")
compile_kernels()
# A busy machine is no reason to fail.
settings.register_profile("seeded", derandomize=True, deadline=None, database=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("seeded")
