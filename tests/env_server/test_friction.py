"""Friction through the loop of the environment: who holds what from step to step, on bodies at rest, moving and turning."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rubbing_scenes import RADIUS, Motion, floor, stepping
from scipy.spatial.transform import Rotation

from env_server.stepped import Stepped
from protocol.kinds import Friction, Hold, Outcome
from protocol.messages import Shape
from protocol.scene import Body, Cable, Gripper, Move, Scene, Target, Vector
from shape_server.hard_cases.posing import ALONG_X, straight

WEIGHT = 0.981  # N, of the cable
LAWS: dict[Friction, dict[str, Any]] = {
    Friction.NONE: {},
    Friction.BOND: {},
    Friction.SIGNUM: {"friction_coefficient": 0.5},
    Friction.REGULARIZED: {"friction_coefficient": 0.5, "friction_speed": 0.01},
    Friction.DEFINED: {"friction_table": ((0.0, 0.6), (0.01, 0.25), (1.0, 0.25))},
}
STEPS = 8


def on_the_floor(folder: Path, kind: Friction, *moves: Vector, seconds: float = 1.0, bending: float = 1e-3, **law: Any) -> Scene:
    """A cable that lies along x on a floor, its last end in a gripper that moves by `moves`, one after the other."""
    numbers = law or LAWS[kind]
    return Scene(
        title="a cable on the floor",
        cables=(Cable("c", 1.0, 2 * RADIUS, 0.1, bending, bending),),
        grippers=(Gripper("g", "c", 1.0, (1.0, 0.0, RADIUS), (1.0, 0.0, 0.0), hold=Hold.HINGE),),
        moves=tuple(Move(f"move {k}", seconds, (Target("g", by=by),)) for k, by in enumerate(moves)),
        bodies=(Body("floor", mesh=floor(folder), friction=kind, **numbers),),
        time_step=seconds / STEPS,
        tolerance=1e-2,
    )


def run(scene: Scene, motion: Motion | None = None) -> list[Stepped]:
    """All steps, from lying at rest."""
    with stepping(scene, straight(ALONG_X, 16, np.zeros((1, 3))), motion) as loop:
        steps: list[Stepped] = []
        for step in range(1, STEPS * len(scene.moves) + 1):
            steps.append(loop.advance(step))
            shape = steps[-1].cables[0].shape
            assert shape.outcome is Outcome.CONVERGED, shape.sentence
    return steps


def shapes(steps: list[Stepped]) -> list[Shape]:
    return [step.cables[0].shape for step in steps]


def test_a_cable_at_rest_on_a_floor_does_not_drift(tmp_path: Path) -> None:
    """Along the floor not by more than rounding; its height is found anew at every step, within the tolerance of the iteration."""
    after = shapes(run(on_the_floor(tmp_path, Friction.SIGNUM, *[(0.0, 0.0, 0.0)] * 3)))
    for shape in after[3:]:
        np.testing.assert_allclose(shape.nodes[:, :2], after[2].nodes[:, :2], atol=1e-14)  # m; measured 2e-17
        np.testing.assert_allclose(shape.nodes[:, 2], after[2].nodes[:, 2], atol=5e-9)  # m; measured 2.6e-9


def test_a_cable_that_was_drawn_and_let_be_stays_where_it_is_and_keeps_its_forces(tmp_path: Path) -> None:
    """Every point slid, and bears all its friction still: nothing is left to creep."""
    after = shapes(run(on_the_floor(tmp_path, Friction.SIGNUM, (0.02, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))))
    drawn, rest = after[STEPS - 1], after[STEPS:]
    assert drawn.nodes[0, 0] == pytest.approx(0.02, abs=1e-9)
    assert max(float(np.abs(shape.nodes - drawn.nodes).max()) for shape in rest) < 1e-11  # m; measured 1e-13
    assert rest[-1].grasp_wrenches[0, 0] == pytest.approx(drawn.grasp_wrenches[0, 0], rel=1e-5)


def test_a_cable_on_a_very_rough_floor_knows_its_error_so_that_it_needs_no_more_nodes(tmp_path: Path) -> None:
    """Nothing but the floor keeps it from swinging about its hinge; without an estimate it was cut in two again and again."""
    for shape in shapes(run(on_the_floor(tmp_path, Friction.SIGNUM, (0.05, 0.0, 0.0), friction_coefficient=10.0))):
        assert shape.error is not None
        assert len(shape.s) == 17  # 513 before


@pytest.mark.parametrize("bending", [1e-6, 1e-3, 1e-1])
def test_a_dragged_cable_is_pulled_by_the_friction_of_all_that_is_behind(tmp_path: Path, bending: float) -> None:
    """T(s) = mu w s (Coulomb 1785), from the free end on; the part of the last node that the gripper bears does not rub."""
    shape = shapes(run(on_the_floor(tmp_path, Friction.SIGNUM, (0.05, 0.0, 0.0), bending=bending)))[-1]
    middle = 0.5 * (shape.s[1:] + shape.s[:-1])
    np.testing.assert_allclose(shape.tension, 0.5 * WEIGHT * middle, atol=2e-6 * WEIGHT)  # measured 4e-7
    assert shape.nodes[0, 0] == pytest.approx(0.05, abs=1e-7)


def test_regularized_friction_pulls_as_its_closed_form_at_every_speed(tmp_path: Path) -> None:
    """All points slide at the gripper's speed v, so T(s) = mu w s v / sqrt(v^2 + v0^2), at every step."""
    steps = run(on_the_floor(tmp_path, Friction.REGULARIZED, (0.02, 0.0, 0.0)))
    before = 0.0
    for shape in shapes(steps)[:-1]:
        speed, before = (shape.nodes[-1, 0] - 1.0 - before) * STEPS, shape.nodes[-1, 0] - 1.0
        middle = 0.5 * (shape.s[1:] + shape.s[:-1])
        np.testing.assert_allclose(shape.tension, 0.5 * WEIGHT * middle * speed / np.hypot(speed, 0.01), atol=1e-5 * WEIGHT)


def test_a_table_has_more_friction_at_rest_than_sliding(tmp_path: Path) -> None:
    """Drawn by 2 um a step, less than the springs of the points that stick give way, then quickly."""
    slow = shapes(run(on_the_floor(tmp_path, Friction.DEFINED, (2e-6, 0.0, 0.0))))
    fast = shapes(run(on_the_floor(tmp_path, Friction.DEFINED, (0.05, 0.0, 0.0))))
    pulls = np.array([shape.grasp_wrenches[0, 0] for shape in slow])
    rubs = WEIGHT * 31 / 32  # N; the gripper bears half a segment
    assert pulls.max() == pytest.approx(0.6 * rubs, rel=1e-3)
    assert fast[STEPS // 2].grasp_wrenches[0, 0] == pytest.approx(0.25 * rubs, rel=1e-3)


@pytest.mark.thorough
def test_what_happens_to_a_cable_that_is_drawn_from_the_ground_depends_on_the_friction(tmp_path: Path) -> None:
    """The paper's Fig. 4: one end is lifted and drawn aside; how far the rest follows, and what it takes, kind by kind."""
    lift, draw = (0.0, 0.0, 0.03), (0.04, 0.0, 0.0)
    pull = {}
    for kind in LAWS:
        law = {"friction_table": ((0.0, 0.2), (0.1, 0.3))} if kind is Friction.DEFINED else {}
        shape = shapes(run(on_the_floor(tmp_path, kind, lift, draw, **law)))[-1]
        pull[kind] = float(shape.grasp_wrenches[0, 0])
        assert shape.nodes[:, 2].min() > RADIUS - 1e-5
    assert abs(pull[Friction.NONE]) < 1e-6  # N; without friction nothing holds it back
    # Measured 2.35, 0.41, 0.26 N: a bond holds until the cable is taut, what slides bears no more than mu N.
    assert pull[Friction.BOND] > 0.5 * WEIGHT > pull[Friction.SIGNUM] > pull[Friction.REGULARIZED] > pull[Friction.NONE]
    assert pull[Friction.SIGNUM] > pull[Friction.DEFINED] > pull[Friction.NONE]


@pytest.mark.slow
@pytest.mark.parametrize("kind", [Friction.SIGNUM, Friction.DEFINED])
def test_a_body_that_moves_and_turns_carries_the_cable_along_by_friction(tmp_path: Path, kind: Friction) -> None:
    """Seen from the body nothing happens; without friction the free end stays behind."""
    turn, shift = 0.6, np.array([0.2, -0.1, 0.3])
    motion: Motion = lambda time: (turn * time, time * shift, True)  # noqa: E731
    last = shapes(run(on_the_floor(tmp_path, kind, (0.0, 0.0, 0.0)), motion))[-1]
    there = Rotation.from_rotvec([0.0, 0.0, -turn]).apply(last.nodes - shift)
    at_rest = np.column_stack([last.s, np.zeros(len(last.s)), np.full(len(last.s), RADIUS)])
    np.testing.assert_allclose(there, at_rest, atol=2e-7)  # m; measured 1e-7, the give of the contact
    assert last.rubbed is not None
    assert last.rubbed.is_sticking[:-1].all()  # the gripper bears the last node


@pytest.mark.slow
def test_a_table_that_turns_about_the_gripper_takes_the_cable_round(tmp_path: Path) -> None:
    pivot = np.array([1.0, 0.0, 0.0])
    motion: Motion = lambda time: (time, pivot - Rotation.from_rotvec([0.0, 0.0, time]).apply(pivot), False)  # noqa: E731
    last = shapes(run(on_the_floor(tmp_path, Friction.SIGNUM, (0.0, 0.0, 0.0)), motion))[-1]
    end = Rotation.from_rotvec([0.0, 0.0, 1.0]).apply([-1.0, 0.0, RADIUS]) + pivot
    np.testing.assert_allclose(last.nodes[0], end, atol=1e-6)  # m


def test_a_floor_that_slides_away_below_a_held_cable_drags_it_with_all_its_friction(tmp_path: Path) -> None:
    motion: Motion = lambda time: (0.0, np.array([-0.05 * time, 0.0, 0.0]), False)  # noqa: E731
    last = shapes(run(on_the_floor(tmp_path, Friction.SIGNUM, (0.0, 0.0, 0.0)), motion))[-1]
    borne = WEIGHT / 32  # N, of the last node, by the gripper
    assert last.grasp_wrenches[0, 0] == pytest.approx(0.5 * (WEIGHT - borne), rel=1e-5)
    np.testing.assert_allclose(last.nodes[:, 0], last.s, atol=1e-7)
