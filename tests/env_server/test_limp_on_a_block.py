"""A chain without bending on a block: on its face, and over two of its edges at once.

By symmetry half of it is a straight piece along the face, an arc of the chain's radius about the edge, and a catenary from there to the
gripper that begins along the arc's end. The angle of the arc and the parameter of the catenary meet the gripper's height and the length.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import numpy as np
import pytest
from in_process import Direct
from scipy.optimize import fsolve

from env_server.asking import Asker
from env_server.hard_cases import limp
from env_server.hard_cases.laying import move
from env_server.hard_cases.playing import playing
from protocol.scene import Body, Target

HALF, EDGE, TOP, RADIUS = 0.3, 0.025, 0.02, 0.003  # m: half of the span, edges from the middle, face over the block's middle, of the chain
LENGTH, GRIPPERS = 0.8, 1.0  # m; the latter a height
WEIGHT = limp.CHAIN.mass_per_length * 9.81  # N/m


def catenary(top: float) -> tuple[Callable[[float], tuple[float, float]], float]:
    """Place (x, z) [m] of the chain by arc length [m] from its middle, on a face at height `top`, and its pull [N] along x."""

    def leaving(angle: float, parameter: float) -> tuple[float, float, float]:
        x, z = EDGE + RADIUS * np.sin(angle), top + RADIUS * np.cos(angle)
        return x, z, x - parameter * np.arcsinh(-np.tan(angle))

    def misses(unknowns: np.ndarray) -> list[float]:
        angle, parameter = unknowns
        x, z, lowest = leaving(angle, parameter)
        rise = parameter * (np.cosh((HALF - lowest) / parameter) - np.cosh((x - lowest) / parameter))
        hanging = parameter * (np.sinh((HALF - lowest) / parameter) + np.tan(angle))
        return [z + rise - GRIPPERS, EDGE + RADIUS * angle + hanging - 0.5 * LENGTH]

    angle, parameter = fsolve(misses, [0.6, 0.1], xtol=1e-13)
    assert np.abs(misses(np.array([angle, parameter]))).max() < 1e-12
    x0, z0, lowest = leaving(angle, parameter)

    def place(s: float) -> tuple[float, float]:
        if s <= EDGE:
            return s, top + RADIUS
        if s <= EDGE + RADIUS * angle:
            turned = (s - EDGE) / RADIUS
            return EDGE + RADIUS * np.sin(turned), top + RADIUS * np.cos(turned)
        x = lowest + parameter * np.arcsinh((s - EDGE - RADIUS * angle) / parameter - np.tan(angle))
        return x, z0 + parameter * (np.cosh((x - lowest) / parameter) - np.cosh((x0 - lowest) / parameter))

    return place, parameter * WEIGHT


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_chain_on_a_block_is_where_the_catenaries_over_its_edges_are() -> None:
    block = Body("body", mesh="block", position=(0.0, 0.0, limp.LOWEST - 0.05))
    scene = limp._hanging((block,), move(Target(body="body", by=(0.0, 0.0, 0.1))), tolerance=2e-3)
    with playing(scene, cast(Asker, Direct()), shells=limp.SHELLS) as played:
        shape = played.to()
        place, pull = catenary(float(played.now.posture.surfaces[0, 2]) + TOP)
    expected = np.array([place(abs(s - 0.5 * LENGTH)) for s in shape.s])
    expected[shape.s < 0.5 * LENGTH, 0] *= -1.0
    off = float(np.linalg.norm(shape.nodes[:, [0, 2]] - expected, axis=1).max())
    assert shape.error is not None
    assert off < shape.error  # measured 1.5e-4 of 3.6e-4 m
    assert off < 3e-4
    assert np.abs(shape.grasp_wrenches[:, 0]) == pytest.approx(pull, rel=2e-3)  # measured 6.5e-4
    assert np.abs(shape.nodes[:, 1]).max() < 1e-9
