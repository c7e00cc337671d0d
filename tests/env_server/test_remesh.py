"""More or fewer nodes from step to step: the same polyline, a start that settles at once, and no flicker between two meshes."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from env_server.remesh import FOURFOLD, SEGMENTS_MOST, coarser, finer, is_too_coarse, is_too_fine
from protocol.kinds import Hold
from protocol.messages import Grasps, Problem, Shape, Start
from protocol.scene import Cable
from shape_server import kernels, solve

GRAVITY = (0.0, 0.0, -9.81)
ALONG_X = np.sqrt(0.5) * np.array([0.0, 1.0, 0.0, 1.0])
CABLE = Cable(name="c", length=1.0, diameter=0.01, mass_per_length=0.1, bending=0.01, twist=0.01)
GRASPS = Grasps(
    s=np.array([0.0, 0.5, 1.0]),
    position=np.array([[0.0, 0.0, 0.0], [0.35, 0.1, 0.1], [0.8, 0.0, 0.0]]),
    quaternion=np.array([ALONG_X] * 3),
    hold=(Hold.CLAMP, Hold.HINGE, Hold.CLAMP),
)


def settled(shape: Shape) -> Shape:
    start = Start(s=shape.s, frames=shape.frames, grasp_forces=shape.grasp_wrenches[:, :3].copy())
    return solve(Problem(cable=CABLE, grasps=GRASPS, start=start), GRAVITY, extrapolate=False, path=kernels)


@pytest.fixture(scope="module")
def shape() -> Shape:
    return solve(Problem(cable=CABLE, grasps=GRASPS), GRAVITY, tolerance=1e-3, extrapolate=False, path=kernels)


def test_a_finer_shape_is_the_same_polyline(shape: Shape) -> None:
    fine = finer(shape)
    assert len(fine.s) == 2 * len(shape.s) - 1
    assert np.array_equal(fine.nodes[::2], shape.nodes)
    assert np.linalg.norm(np.diff(fine.nodes, axis=0), axis=1) == pytest.approx(np.diff(fine.s), rel=1e-12)
    assert np.linalg.norm(fine.frames, axis=1) == pytest.approx(1.0, abs=1e-15)


def test_a_finer_start_settles_at_once_with_a_quarter_of_the_error(shape: Shape) -> None:
    again, fine = settled(shape), settled(finer(shape))
    assert fine.sentence == again.sentence == "settled from the start shape"
    assert fine.iterations <= 4
    assert again.error is not None
    assert fine.error == pytest.approx(again.error / 4, rel=0.1)  # 3.96


def test_every_second_node_is_where_it_was(shape: Shape) -> None:
    fine = settled(finer(shape))
    back = coarser(fine)
    assert np.array_equal(back.s, shape.s)
    assert np.array_equal(back.nodes, fine.nodes[::2])
    assert settled(back).nodes == pytest.approx(settled(shape).nodes, abs=1e-9)


def test_more_nodes_are_for_an_error_that_is_unknown_or_above_the_tolerance(shape: Shape) -> None:
    assert is_too_coarse(msgspec.structs.replace(shape, error=1.1e-3), 1e-3)
    assert is_too_coarse(msgspec.structs.replace(shape, error=None), 1e-3)
    assert not is_too_coarse(msgspec.structs.replace(shape, error=0.9e-3), 1e-3)
    fine = shape
    while 2 * len(fine.frames) <= SEGMENTS_MOST:
        fine = finer(fine)
    assert not is_too_coarse(msgspec.structs.replace(fine, error=1.1e-3), 1e-3)


def test_fewer_nodes_are_for_an_error_that_stays_below_the_tolerance_on_them(shape: Shape) -> None:
    fine = msgspec.structs.replace(finer(shape), error=0.99e-3 / FOURFOLD)
    assert is_too_fine(fine, GRASPS, 1e-3)
    assert not is_too_fine(msgspec.structs.replace(fine, error=1.01e-3 / FOURFOLD), GRASPS, 1e-3)
    assert not is_too_coarse(msgspec.structs.replace(coarser(fine), error=4 * 0.99e-3 / FOURFOLD), 1e-3)
    assert not is_too_fine(msgspec.structs.replace(fine, error=None), GRASPS, 1e-3)


def test_a_held_point_stays_a_node(shape: Shape) -> None:
    fine = msgspec.structs.replace(finer(shape), error=1e-9)
    between = msgspec.structs.replace(GRASPS, s=np.array([0.0, float(fine.s[1]), 1.0]))
    assert not is_too_fine(fine, between, 1e-3)
