"""Rows of friction between cables: their slips by differences, and that a pair which turns as a whole does not slip."""

from __future__ import annotations

import numpy as np
import pytest
from rods import KERNELS
from scipy.spatial.transform import Rotation

from shape_server import numpy_path, strand_friction
from shape_server.knots import Knots
from shape_server.rod import Rod
from shape_server.strand_friction import Rubs

SEGMENTS = 12


class _Bent:
    """What the columns need of a rod: its segments and where its positions start."""

    lengths, base = np.full(SEGMENTS, 1.0 / SEGMENTS), 0


def frames(seed: int) -> np.ndarray:
    """Of a cable that bends and twists smoothly (n-1, 4)."""
    turn = np.linspace(0.0, 1.0, SEGMENTS)[:, None] * np.random.default_rng(seed).normal(size=3)
    return np.asarray(Rotation.from_rotvec(turn).as_quat())


def seen(quaternions: list[np.ndarray]) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Nodes and directors of every cable; they start a little apart."""
    axes = [numpy_path.directors(own) for own in quaternions]
    origins = ([0.0, 0.0, 0.0], [0.1, 0.05, 0.02])
    nodes = [numpy_path.positions(own[:, 2], _Bent.lengths, 0, np.array(origin)) for own, origin in zip(axes, origins, strict=True)]
    return nodes, axes


def pair() -> Rubs:
    """One place of each of two cables, with arms askew."""
    rng = np.random.default_rng(3)
    held = Knots(
        cable=np.array([[0, 1]]),
        place=np.array([[5.3, 7.8]]),
        arm=5e-3 * rng.normal(size=(1, 2, 3)),
        upright=np.eye(3)[None, :2],
        beside=np.array([[[4, 5], [7, 8]]]),
        share=np.array([[[0.2, 0.8], [0.7, 0.3]]]),
        give=np.zeros((1, 2, 3)),
    )
    return Rubs(np.array([0]), held, np.array([0.3]))


@pytest.mark.parametrize("path", [numpy_path, KERNELS], ids=["numpy", "compiled"])
def test_columns_are_the_slopes_of_the_slips(path: object) -> None:
    own, begun = pair(), [frames(1), frames(2)]
    _, axes = seen(begun)
    ways = np.linalg.svd(np.array([[0.3, 0.5, 0.8]]))[2][None, 1:]
    rods: list[Rod] = [_Bent(), _Bent()]  # type: ignore[list-item]
    columns = strand_friction.columns(path, own, ways, axes, rods)  # type: ignore[arg-type]
    step = 1e-6
    for cable in range(2):
        for segment in range(SEGMENTS):
            for k in range(3):
                ends = []
                for sign in (1.0, -1.0):
                    moved = [quaternions.copy() for quaternions in begun]
                    turn = sign * step * np.eye(3)[k]
                    moved[cable][segment] = (Rotation.from_quat(begun[cable][segment]) * Rotation.from_rotvec(turn)).as_quat()
                    ends.append(strand_friction.slips(path, own, ways, *seen(moved))[0])  # type: ignore[arg-type]
                slope = (ends[0] - ends[1]) / (2 * step)
                np.testing.assert_allclose(columns[cable][segment, k], slope, atol=2e-9)  # m/rad; measured 2e-10


def test_cables_that_turn_as_a_whole_do_not_slip() -> None:
    """Their arms turn with them; the slip of the axes alone would be the distance of the axes times the angle."""
    own, begun = pair(), [frames(1), frames(2)]
    nodes, axes = seen(begun)
    turn = Rotation.from_rotvec([0.4, -0.7, 0.2]).as_matrix()
    ways = np.linalg.svd(np.array([[0.3, 0.5, 0.8]]))[2][None, 1:]
    turned = [n @ turn.T for n in nodes], [np.einsum("xy,jky->jkx", turn, a) for a in axes]
    before = strand_friction.slips(numpy_path, own, ways, nodes, axes)
    after = strand_friction.slips(numpy_path, own, ways @ turn.T, *turned)
    np.testing.assert_allclose(after, before, atol=1e-15)


def test_strays_tell_sticking_from_sliding_and_how_far_the_law_is_missed() -> None:
    own, hard, push = pair(), 1e-6, np.array([2.0])
    sticking = np.array([[0.1e-6, 0.2e-6]])
    stray, wrong, sticks = strand_friction.strays(own, sticking, -sticking / hard, push, hard)
    assert (stray, wrong, sticks.tolist()) == (0.0, 0.0, [True])
    sliding = np.array([[3e-3, 4e-3]])
    stray, wrong, sticks = strand_friction.strays(own, sliding, -0.3 * 2.0 * sliding / 5e-3, push, hard)
    assert stray == 0.0
    assert wrong < 1e-15
    assert not sticks[0]
    assert strand_friction.strays(own, sliding, np.zeros((1, 2)), push, hard)[1] == pytest.approx(0.6)
