"""Before any test: what numba compiles is compiled, or loaded if it is that of these sources, so that no test is timed with the compiler.

With pytest-xdist its controller does so before it starts its workers, which then load. Hypothesis draws the same examples in every run.

Of tests with many cases that carry `sampled(n)`, every n-th case runs by default, and the others are `thorough`.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections import Counter

import pytest
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


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what `sampled` leaves out, before any test is chosen by its marks."""
    seen: Counter[str] = Counter()
    for item in items:
        sampled = item.get_closest_marker("sampled")
        if sampled is None:
            continue
        name = item.nodeid.split("[")[0]
        if seen[name] % sampled.args[0]:
            item.add_marker("thorough")
        seen[name] += 1
