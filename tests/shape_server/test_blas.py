"""BLAS without the rest of scipy.linalg: it works, it is all that is loaded, and scipy.linalg comes whole when it is asked for."""

from __future__ import annotations

import subprocess
import sys

import pytest

SOLVE = """
import sys
import numpy as np
from numba import njit
from shape_server import kernels, solve
from protocol.kinds import Hold
from protocol.messages import Grasps, Problem
from protocol.scene import Cable
quaternion = np.sqrt(0.5) * np.array([0.0, 1.0, 0.0, 1.0])
ends = np.array([[0.0, 0, 0], [0.6, 0, 0]])
held = Grasps(s=np.array([0.0, 1.0]), position=ends, quaternion=np.array([quaternion] * 2), hold=(Hold.CLAMP,) * 2)
cable = Cable(name="c", length=1.0, diameter=0.01, mass_per_length=0.1, bending=1e-2, twist=8e-3)
assert solve(Problem(cable=cable, grasps=held), (0.0, 0.0, -9.81), path=kernels).is_stable
assert "scipy.linalg" not in sys.modules
assert "shape_server.follower" not in sys.modules
"""
WHOLE = """
import scipy.linalg
from scipy.linalg import cython_blas
assert scipy.linalg.solve(np.eye(2), np.ones(2)).tolist() == [1.0, 1.0]
@njit
def product(a, b): return a @ np.linalg.solve(b, a)
assert np.allclose(product(np.eye(3), 2 * np.eye(3)), np.eye(3) / 2)
from shape_server import Follower, FollowerBatch, Sensitivities, sensitivities, solve_many
"""


def run(code: str) -> None:
    subprocess.run([sys.executable, "-c", code], check=True, timeout=300)


@pytest.mark.thorough
def test_a_first_shape_loads_neither_scipy_linalg_nor_what_only_others_need() -> None:
    run(SOLVE)


@pytest.mark.slow
def test_scipy_linalg_is_whole_when_it_is_asked_for_later() -> None:
    run(SOLVE + WHOLE)


@pytest.mark.thorough
def test_scipy_linalg_is_left_alone_where_it_is_loaded_already() -> None:
    run("import scipy.linalg\n" + SOLVE.replace('assert "scipy.linalg" not in', 'assert "scipy.linalg" in') + WHOLE)
