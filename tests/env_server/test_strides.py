"""No step passes a body: thin walls, sharp lips, fast bodies, with the cable at rest and the body coming for it."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from in_process import Direct, steps
from trimesh import creation

from env_server.hanging import Hanging
from env_server.poses import outside
from env_server.stage import Stage
from env_server.strides import slid_over
from protocol.kinds import Friction, Hold, Primitive
from protocol.messages import Contacts, Problem
from protocol.scene import Body, Cable, Gripper, Move, Robot, Scene, Target
from shape_server import solve

CABLE = Cable(name="c", length=0.8, diameter=0.006, mass_per_length=0.05, bending=2e-3, twist=2e-3)
GRIPPERS = (
    Gripper(name="left", cable="c", at=0.0, position=(0.0, -0.3, 1.0), tangent=(0.0, 1.0, -0.5)),
    Gripper(name="right", cable="c", at=0.8, position=(0.0, 0.3, 1.0), tangent=(0.0, 1.0, 0.5)),
)
LOWEST = 0.78  # m, about where the cable hangs in the middle


def thrown(mesh: Path, position: tuple[float, float, float], target: Target, duration: float, friction: Friction = Friction.NONE) -> Scene:
    body = Body(name="wall", mesh=str(mesh), position=position, friction=friction)
    move = Move(name="throw", duration=duration, targets=(target,))
    return Scene(title="t", cables=(CABLE,), grippers=GRIPPERS, bodies=(body,), moves=(move,), tolerance=5e-4)


def wall(folder: Path, size: tuple[float, float, float]) -> Path:
    path = folder / "wall.stl"
    creation.box(size).export(path)
    return path


def middle(cable: np.ndarray) -> np.ndarray:
    return np.asarray(cable[len(cable) // 2])


@pytest.mark.parametrize("duration", [0.5, 0.1])
def test_a_thin_wall_that_comes_fast_pushes_the_cable_and_never_passes_it(tmp_path: Path, duration: float) -> None:
    """A wall 2 mm thick comes from the side, 0.25 m in 0.5 s or in 0.1 s: up to 19 mm and 94 mm in one time step of 20 ms."""
    scene = thrown(wall(tmp_path, (0.002, 0.2, 0.2)), (-0.10, 0.0, LOWEST), Target(body="wall", by=(0.25, 0.0, 0.0)), duration)
    for _, step in steps(scene):
        cable, face = step.cables[0], step.posture.surfaces[0, 0] + 0.001
        assert cable.shape.outcome.value == "converged", cable.shape.sentence
        assert cable.bodies.penetration < 2e-6
        in_front = np.abs(cable.shape.nodes[:, 1]) < 0.09
        assert (cable.shape.nodes[in_front & (np.abs(cable.shape.nodes[:, 2] - LOWEST) < 0.08), 0] > face).all()
    assert middle(cable.shape.nodes)[0] > 0.15 + 0.003  # it has been pushed along


def test_a_sharp_lip_that_rises_lifts_the_cable(tmp_path: Path) -> None:
    """The upper edge of a plate of 2 mm, across the cable, comes from below, 0.3 m in 0.15 s."""
    scene = thrown(wall(tmp_path, (0.3, 0.002, 0.1)), (0.0, 0.05, LOWEST - 0.2), Target(body="wall", by=(0.0, 0.0, 0.3)), 0.15)
    for _, step in steps(scene):
        cable = step.cables[0]
        assert cable.shape.outcome.value == "converged", cable.shape.sentence
        assert cable.bodies.penetration < 2e-6
    lip = step.posture.surfaces[0, 2] + 0.05
    height = np.interp(0.05, cable.shape.nodes[:, 1], cable.shape.nodes[:, 2])
    assert height == pytest.approx(lip + 0.003, abs=2e-3)  # m; measured 1.5e-3 more, where the cable slopes over the lip
    assert lip > LOWEST + 0.06


def test_a_plate_that_turns_sweeps_the_cable_along(tmp_path: Path) -> None:
    """A wall swings by 0.8 rad about a far hinge: what moves is its end, not its origin."""
    path = tmp_path / "wall.stl"
    box = creation.box((0.4, 0.2, 0.002))
    box.apply_translation((0.3, 0.0, 0.0))
    box.export(path)
    scene = thrown(path, (-0.3, 0.0, LOWEST - 0.15), Target(body="wall", turn=(0.0, -0.8, 0.0)), 0.3)
    for _, step in steps(scene):
        cable = step.cables[0]
        assert cable.shape.outcome.value == "converged", cable.shape.sentence
        assert cable.bodies.penetration < 2e-6
    assert middle(cable.shape.nodes)[2] > LOWEST


def test_a_bond_rides_on_its_body(tmp_path: Path) -> None:
    """A bonding plate rises under the cable, and then carries what it touches along, sideways and about."""
    rise = Target(body="wall", by=(0.0, 0.0, 0.055))
    scene = thrown(wall(tmp_path, (0.1, 0.4, 0.02)), (0.0, 0.0, LOWEST - 0.06), rise, 0.4, Friction.BOND)
    carry = Move(name="carry", duration=0.4, targets=(Target(body="wall", by=(0.03, 0.0, 0.0), turn=(0.0, 0.0, 0.1)),))
    bonds = []
    for _, step in steps(replace(scene, moves=(*scene.moves, carry))):
        cable, surface = step.cables[0], step.posture.surfaces[0]
        assert cable.shape.outcome.value == "converged", cable.shape.sentence
        if step.posture.time > 0.4 - 1e-9:
            bonds.append({round(bond.s, 4): bond.point for bond in cable.boundary.bonds})
    kept = [s for s in bonds[0] if s in bonds[-1]]
    assert len(kept) >= 3
    for s in kept:
        assert np.array_equal(bonds[0][s], bonds[-1][s])  # the same point of the body, which has moved by 30 mm
        axis = np.array([np.interp(s, cable.shape.s, cable.shape.nodes[:, k]) for k in range(3)])
        assert axis == pytest.approx(outside(surface, bonds[-1][s] + [0.0, 0.0, 0.003]), abs=1e-4)  # s is rounded


def test_bodies_that_do_not_come_near_cut_no_step(tmp_path: Path) -> None:
    """A wall that flies by at 40 m/s, two metres off, costs not one request more than one that rests there."""
    counts = []
    for by in ((0.0, 0.0, 0.0), (4.0, 0.0, 0.0)):
        asker = Direct()
        list(steps(thrown(wall(tmp_path, (0.002, 0.2, 0.2)), (-2.0, 3.0, LOWEST), Target(body="wall", by=by), 0.1), asker))
        counts.append(len(asker.requests))
    assert counts[0] == counts[1]


def test_a_hand_that_sweeps_through_a_cable_takes_it_along() -> None:
    """The left arm carries another cable by 0.3 m in 0.2 s, up to 56 mm in a time step; its wrist meets the cable that hangs there."""
    grippers = (
        replace(GRIPPERS[0], position=(0.3, 0.1, 1.4), tangent=(1.0, 0.0, -0.5)),
        replace(GRIPPERS[1], position=(0.9, 0.1, 1.4), tangent=(1.0, 0.0, 0.5)),
        Gripper(name="hand", arm="left", cable="tool", at=0.0, position=(0.6, 0.4, 1.05), tangent=(0.0, -1.0, 0.0)),
    )
    swing = Move(name="swing", duration=0.2, targets=(Target(gripper="hand", by=(0.0, -0.3, 0.0)),))
    cables = (CABLE, replace(CABLE, name="tool", length=0.1))
    for stage, step in steps(Scene(title="t", cables=cables, grippers=grippers, robot=Robot(), moves=(swing,), tolerance=5e-4)):
        names = stage.surface_names
        for cable in step.cables:
            assert cable.shape.outcome.value == "converged", cable.shape.sentence
            assert cable.links.penetration < 2e-6
    pushes = step.cables[0].boundary.pushes
    assert {names[surface] for surface in pushes.surface} == {"left_link7"}
    assert middle(step.cables[0].shape.nodes)[1] < 0.07


@pytest.mark.parametrize(("aside", "is_alone"), [(1.0, True), (0.04, False)])
def test_a_cable_without_bending_may_run_over_a_body_only_where_no_other_is_in_the_way(aside: float, is_alone: bool) -> None:
    """A bead of 50 mm beside the peg, 1 m and 40 mm away from it; and never where the cable is off the body in the end."""
    limp = Cable(name="c", length=0.8, diameter=0.006, mass_per_length=0.05)
    bodies = (
        Body(name="peg", shape=Primitive.POINT, position=(0.0, 0.0, 0.9)),
        Body(name="bead", shape=Primitive.SPHERE, radius=0.05, position=(aside, 0.0, 0.9)),
        Body(name="floor", shape=Primitive.PLANE, position=(0.0, 0.0, 0.0)),
    )
    held = tuple(replace(gripper, hold=Hold.HINGE) for gripper in GRIPPERS)
    with closing(Stage(Scene(title="t", cables=(limp,), grippers=held, bodies=bodies), lambda _: None)) as stage:
        posture = stage.at_step(0)
        first, last, free = (_over_peg(stage, s) for s in (0.36, 0.44, None))
        assert slid_over(stage, posture, [first], [last]) is is_alone
        assert not slid_over(stage, posture, [first], [free])


def _over_peg(stage: Stage, s: float | None) -> Hanging:
    """A cable that hangs over the peg at an arc length [m], or beside it."""
    posture = stage.at_step(0)
    over = (
        None
        if s is None
        else Contacts(
            s=np.array([s]),
            body=np.array([0]),
            feature=np.array([2]),
            point=np.array([[0.0, 0.0, 0.9]]),
            normal=np.array([[0.0, 0.0, 1.0]]),
            direction=np.zeros((1, 3)),
            extent=np.zeros((1, 2)),
            distance=np.array([0.003]),
            friction=np.array([1]),
            force=np.zeros((1, 3)),
        )
    )
    cable = stage.scene.cables[0]
    shape = solve(Problem(cable=cable, grasps=stage.grasps("c", posture), contacts=over), (0.0, 0.0, -9.81), tolerance=1e-3)
    boundary = stage.untouched(0).after(over, shape, posture.surfaces)
    nothing = stage.touch_bodies.search(shape.nodes + 9.0, posture.surfaces[:3], 0.003, 0.01)
    return Hanging(shape, boundary, nothing, nothing)
