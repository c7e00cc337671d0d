"""One cable is lowered on to another and lifted again, in the environment's loop: they touch or stick, and pass through nothing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from in_process import Direct, steps

from env_server.crossed import crossed_of
from env_server.stepped import Stepped
from protocol.kinds import Outcome, SelfInteraction, SelfTouch
from protocol.scene import Cable, Gripper, Move, Scene, Target

WEIGHT = 0.1 * 9.81  # N, of each cable
CONTACT, BOND = SelfInteraction.CONTACT, SelfInteraction.BOND


def cable(name: str, kind: SelfInteraction) -> Cable:
    return Cable(name, 1.0, 0.01, 0.1, 1e-2, 8e-3, self_interaction=kind)


def scene(kind: SelfInteraction, *heights: float, aside: float = 0.02) -> Scene:
    """Two cables that cross at right angles; the upper one, 50 mm above, goes down and up by these heights [m] in turn."""
    grippers = []
    for name, along, place in (("lower", 0, (0.0, 0.0, 1.0)), ("upper", 1, (aside, 0.0, 1.05))):
        for end, at in ((-1, 0.0), (1, 1.0)):
            tangent, position = np.eye(3)[along], np.array(place) + 0.45 * end * np.eye(3)[along]
            grippers.append(Gripper(f"{name}{end}", name, at, tuple(position.tolist()), tuple(tangent.tolist())))
    moves = tuple(
        Move(f"move {k}", 0.5, tuple(Target(gripper=f"upper{end}", by=(0.0, 0.0, height)) for end in (-1, 1)))
        for k, height in enumerate(heights)
    )
    cables = (cable("lower", kind), cable("upper", kind))
    return Scene("t", cables, tuple(grippers), moves, time_step=0.05, tolerance=2e-3)


@cache
def played(kind: SelfInteraction, *heights: float) -> tuple[list[Stepped], Direct]:
    direct = Direct()
    out = [step for _, step in steps(scene(kind, *heights), direct)]
    assert all(c.shape.outcome is Outcome.CONVERGED for c in out[-1].cables), out[-1].cables[0].shape.sentence
    return out, direct


def middles(step: Stepped) -> Iterator[float]:
    """Height [m] of the middle of each cable."""
    for hanging in step.cables:
        yield float(np.interp(0.5, hanging.shape.s, hanging.shape.nodes[:, 2]))


def test_a_cable_laid_on_another_is_borne_by_it_and_lifted_off_again() -> None:
    out, _ = played(CONTACT, -0.045, 0.045)
    pushes = np.array([step.crossed.pushes.force.sum(axis=0)[2] if step.crossed else 0.0 for step in out])
    assert -0.6 * WEIGHT < pushes.min() < -0.25 * WEIGHT  # N, on the lower cable
    assert pushes[0] == pushes[-1] == 0.0
    there, back = pushes[:11], pushes[:9:-1]
    np.testing.assert_allclose(there, back, atol=1e-6)  # without friction the way does not matter


def test_cables_that_touch_are_not_in_each_other_and_the_grasps_bear_both() -> None:
    out, _ = played(CONTACT, -0.045, 0.045)
    for step in out:
        assert step.crossed is not None
        # Of the polygons; the smooth axes, which run inside them by kappa h^2 / 8 each, are 1e-7 m deep at most.
        assert min(found.gap.min(initial=1.0) for found in step.crossed.near) > -3e-4
        force = sum(hanging.shape.grasp_wrenches[:, :3].sum(axis=0) for hanging in step.cables)
        np.testing.assert_allclose(force, [0.0, 0.0, 2 * WEIGHT], atol=1e-9)
    assert all(step.rounds < 20 for step in out)


def test_cables_that_stick_are_stuck_where_they_first_touched_and_lift_each_other() -> None:
    out, direct = played(BOND, -0.04, 0.03)
    first = next(step for step in out if step.crossed is not None and step.crossed.knots)
    assert first.crossed is not None
    for step in out[out.index(first) :]:
        assert step.crossed is not None
        (knot,) = step.crossed.knots
        assert knot.s == first.crossed.knots[0].s  # the material points stay
    assert out[-1].crossed is not None
    assert out[-1].crossed.knots[0].force[2] > 0.25 * WEIGHT  # it hangs on the upper one
    alone, _ = played(CONTACT, -0.04, 0.03)
    assert next(middles(out[-1])) > next(middles(alone[-1])) + 5e-3
    gap = [request.crossings for request in direct.requests if request.crossings is not None]
    assert gap[-1].kind[-1] == SelfTouch.BOND


def test_cables_of_different_kinds_pass_through_each_other_and_ask_about_nothing() -> None:
    mixed = replace(scene(CONTACT), cables=(cable("lower", CONTACT), cable("upper", SelfInteraction.TRANSPARENT)))
    assert crossed_of(mixed.cables) is None
    assert crossed_of((cable("a", CONTACT), cable("b", BOND), cable("c", CONTACT))).pairs[0].second == 2  # type: ignore[union-attr]


@pytest.mark.slow
def test_a_step_that_would_take_one_cable_through_another_is_cut() -> None:
    """Lowered by eight diameters in one step: it arrives on the same side."""
    fast = replace(scene(CONTACT, -0.045), time_step=0.5)
    *_, (_, step) = steps(fast)
    assert step.crossed is not None
    assert step.crossed.pushes.force.sum(axis=0)[2] < -0.25 * WEIGHT
    below, above = middles(step)
    assert above > below
