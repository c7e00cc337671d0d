"""A cable that sticks to itself is wound up and turned back: it stays stuck where it first touched, and does not come back to its shape."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from in_process import Direct, steps
from test_self_boundary import DIAMETER, wound

from env_server.polyline import smooth_at
from env_server.stepped import Stepped
from protocol.kinds import Outcome, SelfInteraction
from protocol.scene import Move, Target

BACK = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0))


@cache
def played(quarters: int, tolerance: float = 5e-3) -> tuple[list[Stepped], Direct]:
    """All steps of winding up by seven quarters of a turn, and back by some, from the first bond on with the tolerance [m]."""
    scene, direct = wound(SelfInteraction.BOND), Direct()
    back = tuple(Move(f"back {k}", 1.0, (Target(gripper="right", approach=approach),)) for k, approach in enumerate(BACK[:quarters]))
    out = []
    for stage, step in steps(replace(scene, moves=scene.moves + back), direct):
        assert step.cables[0].shape.outcome is Outcome.CONVERGED, step.cables[0].shape.sentence
        out.append(step)
        if step.crossed is not None and step.crossed.knots:
            object.__setattr__(stage, "tolerance", tolerance)
    return out, direct


def stuck(out: list[Stepped]) -> list[Stepped]:
    """The steps from the first bond on."""
    return [step for step in out if step.crossed is not None and step.crossed.knots]


@pytest.mark.thorough
def test_two_points_stick_where_they_first_touch_and_stay_a_diameter_apart() -> None:
    on = stuck(played(0)[0])
    assert len(on) == 8  # of the last quarter turn, in which it snaps
    for step in on:
        assert step.crossed is not None
        (knot,) = step.crossed.knots
        assert knot.s == on[0].crossed.knots[0].s  # type: ignore[union-attr]
        first, second = smooth_at(step.cables[0].shape, np.array(knot.s))
        assert np.linalg.norm(first - second) == pytest.approx(DIAMETER, abs=1e-5)  # m
    assert 0.3 < np.linalg.norm(on[-1].crossed.knots[0].force) < 0.6  # type: ignore[union-attr]  # N; measured 0.46


def test_a_bond_with_itself_adds_nothing_to_the_weight_that_the_grippers_bear() -> None:
    for step in stuck(played(0)[0]):
        force = step.cables[0].shape.grasp_wrenches[:, :3].sum(axis=0)
        np.testing.assert_allclose(force, [0.0, 0.0, 0.02 * 9.81], atol=1e-9)


def test_places_at_a_bond_are_not_asked_about_as_contacts() -> None:
    last = played(0)[1].requests[-1]
    assert last.crossings is not None
    own = last.problems[0].self_contacts
    if own is not None:
        size = 1.6 / 48  # m, about one and a half segments
        assert (np.abs(own.s - last.crossings.s[0]).max(axis=1) > 0.9 * size).all()


@pytest.mark.slow
def test_other_nodes_keep_the_points_that_stick() -> None:
    out = stuck(played(0, 4e-4)[0])
    assert len({len(step.cables[0].shape.s) for step in out}) > 1
    assert len({step.crossed.knots[0].s for step in out if step.crossed is not None}) == 1
    coarse, fine = stuck(played(0)[0])[-1].cables[0].shape, out[-1].cables[0].shape
    again = np.column_stack([np.interp(coarse.s, fine.s, column) for column in fine.nodes.T])
    assert np.linalg.norm(again - coarse.nodes, axis=1).max() < 1e-3  # m; measured 3.2e-4


@pytest.mark.slow
def test_turned_back_it_does_not_come_back() -> None:
    """The same way back: what is stuck stays wound, and the ends have to twist the other way for it."""
    out, _ = played(7)
    assert out[0].crossed is not None
    assert not out[0].crossed.knots
    assert np.linalg.norm(out[0].cables[0].shape.nodes - out[-1].cables[0].shape.nodes, axis=1).max() > 0.1  # m
    assert abs(out[0].cables[0].shape.total_twist) < 1e-6
    assert out[-1].cables[0].shape.total_twist < -0.7 * 2 * np.pi  # measured -0.89 turns
    for step in stuck(out):
        first, second = smooth_at(step.cables[0].shape, np.array(step.crossed.knots[0].s))  # type: ignore[union-attr]
        assert np.linalg.norm(first - second) == pytest.approx(DIAMETER, abs=1e-4)  # m
