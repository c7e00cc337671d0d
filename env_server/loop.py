"""One time step after the flow chart of the paper's Fig. 9: move, ask for the shape, look where it touches, decide, repeat.

A round sends the present boundary conditions to the shape server and looks at the answer with exact distances. The step
has settled when nothing is penetrated deeper than `boundary.DEPTH_OK` and every push comes from a body that is there. No
cable may move further in one step than its distance to the nearest body (conservative advancement), so nothing is passed
through; a step that would, or that does not settle, is halved. History is what a step starts from: the last shape and the
contacts it kept. A step that fails changes none of it.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import msgspec
import numpy as np

from protocol.kinds import Outcome
from protocol.messages import Bill, Grasps, Problem, Shape, ShapeRequest, Start, TouchPoints

from .asking import Asker
from .boundary import Boundary
from .poses import farthest_move
from .stage import Posture, Stage
from .touch import Candidates

ROUNDS_MAX: Final = 12
ROUNDS_JUMP: Final = 60  # when a cable snaps to another posture, its contacts give way one after the other
HALVINGS_MAX: Final = 5  # a step is cut into at most 2^5 parts; what still jumps then is a jump of the cable
REACH_LEAST, REACH_MOST = 2e-3, 12e-3  # m, gap within which a place is handed to the shape server
AHEAD: Final = 1.5  # reach, in units of how far the cable went in the last step


@dataclass(frozen=True)
class Hanging:
    """One cable as the last step left it."""

    shape: Shape
    boundary: Boundary
    bodies: Candidates
    links: Candidates


@dataclass
class Meter:
    """Seconds spent in the present step, by part."""

    solve: float = 0.0
    search: float = 0.0
    robot: float = 0.0
    wire: float = 0.0


@dataclass(frozen=True)
class Stepped:
    """A time step as it ended."""

    posture: Posture
    cables: tuple[Hanging, ...]
    rounds: int
    collisions: tuple[tuple[str, str], ...]
    bill: Bill


@dataclass
class _Try:
    """What one attempt at a step came to."""

    cables: tuple[Hanging, ...] = ()
    rounds: int = 0
    is_settled: bool = False
    may_have_passed: bool = False
    shapes: tuple[Shape, ...] = field(default=())


class Loop:
    """Steps the cables of a scene through time."""

    def __init__(self, stage: Stage, asker: Asker, session: str) -> None:
        self._stage = stage
        self._asker = asker
        self._session = session
        self._meter = Meter()
        self._collisions: tuple[tuple[str, str], ...] = ()
        self._round = 0
        self._reach = self._reach_links = REACH_MOST
        self._now: Stepped | None = None

    def first(self) -> Stepped:
        """The shapes at the start, from the grasps alone."""
        return self._measured(0, self._stage.at_step(0), None)

    def advance(self, step: int) -> Stepped:
        """The next time step; `first` must have been called."""
        return self._measured(step, self._stage.at_step(step), self._now)

    def _measured(self, step: int, goal: Posture, before: Stepped | None) -> Stepped:
        begun, coded = time.perf_counter(), self._asker.coding
        self._meter = Meter()
        self._round = 0
        posture, cables, rounds = self._go(step, goal, before, 0)
        meter = self._meter
        bill = Bill(
            solve=meter.solve,
            search=meter.search,
            robot=meter.robot,
            encode=self._asker.coding - coded,
            wire=meter.wire,
            wait=0.0,
            total=time.perf_counter() - begun,
        )
        stepped = Stepped(posture, cables, rounds, self._collisions, bill)
        if all(cable.shape.outcome is Outcome.CONVERGED for cable in cables):
            self._now = stepped
        return stepped

    def _go(self, step: int, goal: Posture, before: Stepped | None, depth: int) -> tuple[Posture, tuple[Hanging, ...], int]:
        """Reach the goal in one go, or in two halves if that does not settle or could pass through a body."""
        is_last = before is None or depth == HALVINGS_MAX
        done = self._try(step, goal, before, may_jump=is_last)
        if before is None or is_last:
            return goal, done.cables if done.is_settled else _unsettled(done.cables), done.rounds
        if done.is_settled and not done.may_have_passed:
            return goal, done.cables, done.rounds
        middle = self._stage.between(0.5 * (before.posture.time + goal.time), before.posture.joints)
        posture, cables, rounds = self._go(step, middle, before, depth + 1)
        if any(cable.shape.outcome is not Outcome.CONVERGED for cable in cables):
            return posture, cables, done.rounds + rounds
        half = replace(before, posture=posture, cables=cables)
        posture, cables, more = self._go(step, goal, half, depth + 1)
        return posture, cables, done.rounds + rounds + more

    def _try(self, step: int, goal: Posture, before: Stepped | None, *, may_jump: bool) -> _Try:
        """Rounds of the boundary conditions at one posture; given up early if a body may have been passed, unless it may jump."""
        scene, done = self._stage.scene, _Try()
        grasps = [self._stage.grasps(cable.name, goal) for cable in scene.cables]
        cables = self._begin(goal, before, grasps)
        has_moved_robot = False
        while done.rounds < (ROUNDS_JUMP if may_jump else ROUNDS_MAX):
            done.rounds += 1
            contacts = [
                cable.boundary.contacts(_joined(cable, self._stage.body_count, self._reach), cable.shape.s, goal.surfaces)
                if cable is not None
                else None
                for cable in cables
            ]
            problems = tuple(
                Problem(cable=cable, grasps=grasp, contacts=contact, start=_start(was))
                for cable, grasp, contact, was in zip(scene.cables, grasps, contacts, cables, strict=True)
            )
            shapes = self._ask(step, problems, goal, has_moved_robot=has_moved_robot)
            has_moved_robot = True
            if any(shape.outcome is not Outcome.CONVERGED for shape in shapes):
                done.cables = tuple(
                    replace(was, shape=shape) if was is not None else _nowhere(shape, self._fresh(index))
                    for index, (was, shape) in enumerate(zip(cables, shapes, strict=True))
                )
                return done
            begun = time.perf_counter()
            hanging = []
            done.is_settled = True
            for index, (was, shape, contact) in enumerate(zip(cables, shapes, contacts, strict=True)):
                boundary = (was.boundary if was is not None else self._fresh(index)).after(contact, shape, goal.surfaces)
                now = Hanging(shape, boundary, *self._search(index, shape, goal, was))
                done.is_settled &= boundary.is_settled(_joined(now, self._stage.body_count, self._reach), shape.s)
                hanging.append(now)
            self._meter.search += time.perf_counter() - begun
            cables = hanging
            done.cables = tuple(hanging)
            done.may_have_passed = before is not None and self._may_have_passed(before, goal, done.cables)
            if done.is_settled or (done.may_have_passed and not may_jump):
                break
        if done.is_settled:
            done.cables = tuple(replace(cable, boundary=cable.boundary.bonded(goal.surfaces, float(np.diff(cable.shape.s).max()))) for cable in done.cables)
        return done

    def _begin(self, goal: Posture, before: Stepped | None, grasps: list[Grasps]) -> Sequence[Hanging | None]:
        """Where each cable starts from: the last step, looked at anew where a robot link near it has moved."""
        if before is None:
            return [None] * len(grasps)
        begun = time.perf_counter()
        cables = []
        for index, (cable, grasp) in enumerate(zip(before.cables, grasps, strict=True)):
            boundary = cable.boundary.drawn_through(grasp, goal.surfaces)
            links = self._search_links(index, cable.shape, goal, cable) if len(cable.links.body) else cable.links
            cables.append(replace(cable, boundary=boundary, links=links))
        self._meter.search += time.perf_counter() - begun
        return cables

    def _ask(self, step: int, problems: tuple[Problem, ...], goal: Posture, *, has_moved_robot: bool) -> tuple[Shape, ...]:
        """Ask the shape server, and move the robot while it thinks."""
        scene = self._stage.scene
        request = ShapeRequest(
            session=self._session, step=step, round=self._round, gravity=scene.gravity, tolerance=scene.tolerance, problems=problems
        )
        self._round += 1
        begun = time.perf_counter()
        self._asker.send(request)
        sent = time.perf_counter()
        if not has_moved_robot:
            self._stage.world.set_joints(goal.joints)
            self._collisions = self._stage.world.collisions()
        moved = time.perf_counter()
        coded = self._asker.coding
        reply = self._asker.receive()
        self._meter.robot += moved - sent
        self._meter.solve += reply.busy
        trip = time.perf_counter() - begun - (self._asker.coding - coded)
        self._meter.wire += max(0.0, trip - max(reply.busy, moved - sent))
        return reply.shapes

    def _search(self, index: int, shape: Shape, goal: Posture, previous: Hanging | None) -> tuple[Candidates, Candidates]:
        """Places within reach on the bodies and on the robot's links."""
        cable, count = self._stage.scene.cables[index], self._stage.body_count
        radius = 0.5 * cable.diameter
        bodies = self._stage.touch_bodies.search(
            shape.nodes, goal.surfaces[:count], radius, self._reach, previous=previous.bodies if previous is not None else None
        )
        return bodies, self._search_links(index, shape, goal, previous)

    def _search_links(self, index: int, shape: Shape, goal: Posture, previous: Hanging | None) -> Candidates:
        """Places within reach on the robot's links."""
        cable = self._stage.scene.cables[index]
        return self._stage.touch_links.search(
            shape.nodes,
            goal.surfaces[self._stage.body_count :],
            0.5 * cable.diameter,
            self._reach_links,
            excluded=self._stage.excluded(cable.name, shape.s),
            previous=previous.links if previous is not None else None,
        )

    def _may_have_passed(self, before: Stepped, goal: Posture, after: tuple[Hanging, ...]) -> bool:
        """Whether a segment moved further than its distance to the nearest body was."""
        count = self._stage.body_count
        still = farthest_move(before.posture.surfaces[:count], goal.surfaces[:count], self._stage.extents[:count])
        turning = farthest_move(before.posture.surfaces[count:], goal.surfaces[count:], self._stage.extents[count:])
        farthest, passed = 0.0, False
        for was, now in zip(before.cables, after, strict=True):
            node = np.linalg.norm(now.shape.nodes - was.shape.nodes, axis=1)
            segment = np.maximum(node[1:], node[:-1])
            farthest = max(farthest, float(node.max()))
            passed |= bool((segment + still > was.bodies.clearance).any())
            passed |= bool((segment + turning > was.links.clearance).any())
        self._reach = float(np.clip(AHEAD * (farthest + still), REACH_LEAST, REACH_MOST))
        self._reach_links = max(self._reach, AHEAD * (farthest + turning))
        return passed

    def _fresh(self, index: int) -> Boundary:
        cable = self._stage.scene.cables[index]
        return Boundary(radius=0.5 * cable.diameter, length=cable.length, bonding=self._stage.bonding)


def touch_points(stage: Stage, stepped: Stepped) -> TouchPoints:
    """The contacts of a step that carry a force, for its frame."""
    pushes = [(index, cable.boundary.pushes) for index, cable in enumerate(stepped.cables)]
    return TouchPoints(
        cable=np.concatenate([np.full(len(p.s), index, dtype=np.int64) for index, p in pushes]),
        body=np.concatenate([stage.solid_of_surface[p.surface] for _, p in pushes]),
        s=np.concatenate([p.s for _, p in pushes]),
        point=np.vstack([p.point for _, p in pushes]),
        force=np.vstack([p.force for _, p in pushes]),
    )


def _start(was: Hanging | None) -> Start | None:
    if was is None:
        return None
    return Start(s=was.shape.s, frames=was.shape.frames, grasp_forces=was.shape.grasp_wrenches[:, :3])


def _joined(cable: Hanging, body_count: int, reach: float) -> Candidates:
    """Places on bodies and links within reach as one list, numbered as the surfaces are."""
    near = cable.links.gap < reach
    if not near.any():
        return cable.bodies
    first, second = cable.bodies, cable.links
    names = ("segment", "fraction", "feature", "feature_id", "point", "normal", "direction", "extent", "gap", "is_crossing", "is_beyond")
    columns = {name: np.concatenate([getattr(first, name), getattr(second, name)[near]]) for name in names}
    return Candidates(
        **columns,
        body=np.concatenate([first.body, second.body[near] + body_count]),
        clearance=np.minimum(first.clearance, second.clearance),
    )


def _unsettled(cables: tuple[Hanging, ...]) -> tuple[Hanging, ...]:
    """The cables of a step whose contacts never settled: no shape to go on from."""
    sentence = f"its contacts do not settle within {ROUNDS_JUMP} rounds, in steps {2**HALVINGS_MAX} times smaller than asked for"
    return tuple(
        replace(cable, shape=msgspec.structs.replace(cable.shape, outcome=Outcome.NOT_CONVERGED, sentence=sentence))
        if cable.shape.outcome is Outcome.CONVERGED
        else cable
        for cable in cables
    )


def _nowhere(shape: Shape, boundary: Boundary) -> Hanging:
    """A cable without a shape, whose outcome says why."""
    none = np.zeros(0)
    nothing = Candidates(**dict.fromkeys(Candidates.__slots__, none))
    return Hanging(shape, boundary, nothing, nothing)
