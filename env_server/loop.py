"""One time step after the flow chart of the paper's Fig. 9: move, ask for the shape, look where it touches, decide, repeat.

A round sends the present boundary conditions to the shape server and looks at the answer with exact distances. The step has settled when
nothing is penetrated deeper than `boundary.DEPTH_OK` and every push comes from a body that is there. No cable may move further in one step
than its distance to the nearest body (conservative advancement), so nothing is passed through; a step that would, or that does not settle,
is halved; one whose error is above the tolerance is repeated on more nodes (`remesh`), one that one more round would change by more gets it
(`coupling`). History is what a step starts from: the last shape and the contacts it kept. A step that fails changes none of it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from protocol.effects import table_of
from protocol.kinds import Outcome
from protocol.messages import CrossingReactions, Crossings, Grasps, Problem, Shape, ShapeRequest

from . import coupling, looking, remesh
from .asking import Asker
from .audit import Auditor, Audits, heard
from .crossed import Crossed
from .first_touch import with_first_touches, within
from .hanging import Hanging, accepted, joined, least_share, nowhere, part_way, start_of, unsettled
from .looking import Reach
from .stage import Posture, Stage
from .stepped import Meter, Stepped, Try
from .strides import HALVINGS_MOST, free_share, outruns, rigid_motion, slid_over, slipped_through

ROUNDS_MAX: Final = 12
ROUNDS_JUMP: Final = 60  # when a cable snaps to another posture, its contacts give way one after the other
HALVINGS_MAX: Final = 5  # a step is cut into at most 2^5 parts; what still jumps then is a jump of the cable
REACH_LEAST, REACH_MOST = 2e-3, 12e-3  # m, gap within which a place is handed to the shape server
UNSETTLED: Final = f"its contacts do not settle within {ROUNDS_JUMP} rounds, in steps {2**HALVINGS_MAX} times smaller than asked for"
LEAST_SHARE: Final = 0.02  # of the way to a shape that is beyond a body, taken in any case
AHEAD: Final = 1.5  # reach, in units of how far the cable went in the last step


class Loop:
    """Steps the cables of a scene through time."""

    def __init__(self, stage: Stage, asker: Asker, session: str, auditor: Auditor | None = None) -> None:
        self._stage = stage
        self._asker = asker
        self._auditor = auditor
        self._audits = Audits()
        self._session = session
        self._meter = Meter()
        self._collisions: tuple[tuple[str, str], ...] = ()
        self._round = 0
        self._reach = Reach(REACH_MOST, REACH_MOST, REACH_MOST)
        self._now: Stepped | None = None

    def first(self) -> Stepped:
        """The shapes at the start, from the grasps alone."""
        return self._measured(0, self._stage.at_step(0), None)

    def advance(self, step: int) -> Stepped:
        """The next time step; `first` must have been called."""
        return self._measured(step, self._stage.at_step(step), self._now)

    def tried(self, step: int, goal: Posture, before: Stepped) -> Stepped:
        """Where a step from `before` to another posture ends. The loop goes on as if it had not been asked."""
        kept = self._reach, self._collisions
        posture, done = self._go(step, goal, before, 0)
        self._reach, self._collisions = kept
        return replace(before, posture=posture, cables=done.cables, crossed=done.crossed, rounds=done.rounds)

    def _measured(self, step: int, goal: Posture, before: Stepped | None) -> Stepped:
        begun, coded = time.perf_counter(), self._asker.coding
        self._meter = Meter()
        self._round = 0
        self._audits, audits = heard(self._auditor, step, self._audits, self._meter)
        if before is not None:
            before = self._with_fewer_nodes(before)
        posture, done = self._go(step, goal, before, 0)
        while before is not None and remesh.are_too_coarse([cable.shape for cable in done.cables], self._stage.tolerance):
            coarse = [remesh.is_too_coarse(cable.shape, self._stage.tolerance) for cable in done.cables]
            before = self._on_nodes(before, remesh.finer, coarse)
            reached, again = self._go(step, goal, before, 0)
            again.rounds += done.rounds
            if not again.has_shapes:
                done.rounds = again.rounds
                break
            posture, done = reached, again
        if before is not None:
            done = self._once_more(step, goal, before, done)
        bill = self._meter.bill(encode=self._asker.coding - coded, total=time.perf_counter() - begun - self._meter.wait)
        stepped = Stepped(posture, done.cables, done.rounds, self._collisions, bill, done.crossed, done.coupling, audits)
        if done.has_shapes:
            self._now = stepped
            if self._auditor is not None:
                self._audits = self._auditor.look(step, self._stage.path.steps, self._audits, *done.answered)
        return stepped

    def _once_more(self, step: int, goal: Posture, before: Stepped, done: Try) -> Try:
        """The same step gone on with from where it ended, while one more round would change a cable by more than the tolerance leaves."""
        for _ in range(remesh.AGAIN_MOST):
            if remesh.are_close_enough([cable.shape for cable in done.cables], done.coupling, self._stage.tolerance):
                break
            _, again = self._go(step, goal, replace(before, posture=goal, cables=done.cables, crossed=done.crossed), 0)
            done.rounds = again.rounds = done.rounds + again.rounds
            if not again.has_shapes or max(again.coupling, default=np.inf) >= max(done.coupling):
                break
            done = again
        return done

    def _with_fewer_nodes(self, before: Stepped) -> Stepped:
        """The last step, on half the segments for every cable that needs no more."""
        held = [self._stage.grasps(cable.name, before.posture) for cable in self._stage.scene.cables]
        fine = [remesh.is_too_fine(was.shape, grasps, self._stage.tolerance) for was, grasps in zip(before.cables, held, strict=True)]
        return self._on_nodes(before, remesh.coarser, fine)

    def _on_nodes(self, before: Stepped, made: Callable[[Shape], Shape], chosen: list[bool]) -> Stepped:
        """A step with the chosen cables on other nodes, and what is near them there."""
        begun, cables = time.perf_counter(), list(before.cables)
        for index, was in enumerate(before.cables):
            if chosen[index]:
                shape = made(was.shape)
                cables[index] = Hanging(shape, was.boundary, *looking.near(self._stage, index, shape, before.posture, None, self._reach))
        self._meter.search += time.perf_counter() - begun
        return replace(before, cables=tuple(cables))

    def _go(self, step: int, goal: Posture, before: Stepped | None, depth: int) -> tuple[Posture, Try]:
        """Reach the goal in one go, or in two halves if that does not settle or could pass through a body."""
        is_outrun = False  # by bodies or links that move too far in a step to be sure that they pass no cable
        if before is not None and depth < HALVINGS_MOST:
            is_outrun = outruns(rigid_motion(self._stage, before.posture, goal, before.cables), before.cables)
        is_last = before is None or (depth >= HALVINGS_MAX and not is_outrun)
        done = Try() if is_outrun else self._try(step, goal, before, may_jump=is_last)
        if before is None or is_last:
            done.cables = done.cables if done.is_settled else unsettled(done.cables, UNSETTLED)
            return goal, done
        if done.may_stay(self._stage.tolerance, depth):
            return goal, done
        middle = self._stage.between(0.5 * (before.posture.time + goal.time), before.posture.joints)
        posture, first = self._go(step, middle, before, depth + 1)
        first.rounds += done.rounds
        if not first.has_shapes:
            return posture, first
        half = replace(before, posture=posture, cables=first.cables, crossed=first.crossed)
        posture, second = self._go(step, goal, half, depth + 1)
        second.rounds += first.rounds
        return posture, second

    def _try(self, step: int, goal: Posture, before: Stepped | None, *, may_jump: bool) -> Try:
        """Rounds of the boundary conditions at one posture; given up early if a body may have been passed, unless it may jump."""
        scene, done = self._stage.scene, Try()
        grasps = [self._stage.grasps(cable.name, goal) for cable in scene.cables]
        cables = self._begin(goal, before, grasps)
        # Where the cables were last known to be on the right side of every body, and the bodies' posture then.
        anchor = before.cables if before is not None else None
        crossed = anchor_crossed = self._begin_crossed(before)
        done_at = before.posture if before is not None else goal
        has_moved_robot, look = False, partial(looking.touching, self._stage)
        while done.rounds < (ROUNDS_JUMP if may_jump else ROUNDS_MAX):
            done.rounds += 1
            problems = self._problems(goal, cables, grasps, crossed)
            asked = crossed.asked([was.shape for was in cables if was is not None]) if crossed is not None else None
            shapes, reactions = self._ask(step, problems, asked, goal, has_moved_robot=has_moved_robot)
            has_moved_robot = True
            done.answered = (problems, shapes) if asked is None else ((), ())
            if any(shape.outcome is not Outcome.CONVERGED for shape in shapes):
                done.cables = tuple(
                    replace(was, shape=shape) if was is not None else nowhere(shape, self._stage.untouched(index))
                    for index, (was, shape) in enumerate(zip(cables, shapes, strict=True))
                )
                return done
            begun = time.perf_counter()
            hanging, done.is_settled = looking.seen(self._stage, cables, shapes, problems, goal, self._reach, crossed)
            if crossed is not None:
                crossed = crossed.after(asked, reactions).looked(shapes, self._reach.own)
                done.is_settled &= crossed.is_settled(asked, shapes)
            share = self._free_share(anchor, anchor_crossed, done_at, goal, hanging)
            done.may_have_passed = share < 1.0
            has_slid = done.is_settled and may_jump and share < 1.0 and slid_over(self._stage, goal, anchor or (), hanging)
            if anchor is not None and share < 1.0 and may_jump and not has_slid:
                hanging = [self._part_way(*item, share, goal) for item in enumerate(zip(anchor, hanging, grasps, strict=True))]
                done.is_settled = False
                crossed = crossed.looked([cable.shape for cable in hanging], self._reach.own) if crossed is not None else None
            self._meter.search += time.perf_counter() - begun
            cables = done.cables = tuple(hanging)
            if done.is_settled or (done.may_have_passed and not may_jump):
                break
            if self._stage.may_bond and anchor is None:
                done.cables = within(done.cables)
                break
            touched = with_first_touches(anchor, cables, grasps, (done_at, goal), look) if self._stage.may_bond and anchor else None
            if touched is None:
                anchor, anchor_crossed, done_at = done.cables, crossed, goal
            cables = touched or cables  # again from where nothing was touched yet
        done.is_settled &= before is None or not slipped_through(before.cables, done.cables)
        if done.is_settled or may_jump:
            done.coupling = self._coupling(done.cables, problems, goal)
        if done.is_settled:
            done.cables = accepted(done.cables, [problem.contacts for problem in problems], goal.surfaces, goal.time)
            crossed = crossed.accepted(done.cables) if crossed is not None else None
        done.crossed = crossed
        return done

    def _coupling(self, cables: Sequence[Hanging], asked: Sequence[Problem], goal: Posture) -> tuple[float, ...]:
        """What one more round would change of every cable [m]."""
        begun, count = time.perf_counter(), self._stage.body_count
        changes = tuple(
            coupling.change(was.shape, was.boundary, joined(was, count, self._reach.bodies), own.contacts, own.grasps, goal.surfaces)
            for was, own in zip(cables, asked, strict=True)
        )
        self._meter.search += time.perf_counter() - begun
        return changes

    def _begin_crossed(self, before: Stepped | None) -> Crossed | None:
        """Where cables meet each other to begin with, on the nodes that they have now."""
        if before is None or before.crossed is None:
            return self._stage.crossed
        return before.crossed.looked([cable.shape for cable in before.cables], self._reach.own)

    def _problems(
        self, goal: Posture, cables: Sequence[Hanging | None], grasps: list[Grasps], crossed: Crossed | None
    ) -> tuple[Problem, ...]:
        """What to ask the shape server: every cable with its present boundary conditions."""
        begun, count, table = time.perf_counter(), self._stage.body_count, table_of(self._stage.scene.effects)
        problems = []
        for index, (cable, grasp, was) in enumerate(zip(self._stage.scene.cables, grasps, cables, strict=True)):
            contacts, forced = None, self._audits.table(index, table)
            if was is not None:
                contacts = was.boundary.contacts(joined(was, count, self._reach.bodies), was.shape.s, goal.surfaces, goal.time)
            start, own = start_of(was), looking.meetings(index, was, crossed)
            problems.append(Problem(cable=cable, grasps=grasp, contacts=contacts, start=start, self_contacts=own, effects=forced))
        self._meter.search += time.perf_counter() - begun
        return tuple(problems)

    def _begin(self, goal: Posture, before: Stepped | None, grasps: list[Grasps]) -> Sequence[Hanging | None]:
        """Where each cable starts from: the last step, looked at anew where a body, or a robot link near it, has moved."""
        if before is None:
            return [None] * len(grasps)
        begun = time.perf_counter()
        cables, count = [], self._stage.body_count
        have_moved = not np.array_equal(before.posture.surfaces[:count], goal.surfaces[:count])
        for index, (cable, grasp) in enumerate(zip(before.cables, grasps, strict=True)):
            boundary = cable.boundary.drawn_through(grasp, goal.surfaces)
            links = looking.near_links(self._stage, index, cable.shape, goal, cable, self._reach) if len(cable.links.body) else cable.links
            bodies = looking.near_bodies(self._stage, index, cable.shape, goal, cable, self._reach) if have_moved else cable.bodies
            cables.append(replace(cable, boundary=boundary, bodies=bodies, links=links))
        self._meter.search += time.perf_counter() - begun
        return cables

    def _ask(
        self, step: int, problems: tuple[Problem, ...], asked: Crossings | None, goal: Posture, *, has_moved_robot: bool
    ) -> tuple[tuple[Shape, ...], CrossingReactions | None]:
        """Ask the shape server, and move the robot while it thinks."""
        scene = self._stage.scene
        request = ShapeRequest(
            session=self._session,
            step=step,
            round=self._round,
            gravity=scene.gravity,
            tolerance=scene.tolerance,
            problems=problems,
            extrapolate=False,
            crossings=asked,
        )
        self._round += 1
        begun = time.perf_counter()
        self._asker.send(request)
        sent = time.perf_counter()
        if not has_moved_robot:
            self._stage.put(goal)
            self._collisions = self._stage.world.collisions()
        moved = time.perf_counter()
        coded = self._asker.coding
        reply = self._asker.receive()
        self._meter.robot += moved - sent
        self._meter.solve += reply.busy
        trip = time.perf_counter() - begun - (self._asker.coding - coded)
        self._meter.wire += max(0.0, trip - max(reply.busy, moved - sent))
        return self._audits.marked(reply.shapes), reply.crossings

    def _free_share(
        self, anchor: Sequence[Hanging] | None, crossed: Crossed | None, at: Posture, goal: Posture, after: Sequence[Hanging]
    ) -> float:
        """Share of the way from the anchor that surely passes no body; 1 if no segment went further than its distance to one."""
        if anchor is None:
            return 1.0
        rigid = rigid_motion(self._stage, at, goal, anchor)
        share, farthest = free_share(rigid, anchor, after, crossed)
        bodies = float(np.clip(AHEAD * (farthest + rigid.bodies), REACH_LEAST, REACH_MOST))
        self._reach = Reach(bodies, max(bodies, AHEAD * (farthest + rigid.links)), max(REACH_LEAST, 2 * AHEAD * farthest))
        return share

    def _part_way(self, index: int, item: tuple[Hanging, Hanging, Grasps], share: float, goal: Posture) -> Hanging:
        """A cable as far on its way as surely passes no body, with what is near it there."""
        was, now, grasps = item
        shape = part_way(was.shape, now.shape, max(0.8 * share, least_share(was, now.shape, LEAST_SHARE)), grasps)
        self._reach = replace(self._reach, bodies=REACH_MOST)
        return Hanging(shape, now.boundary, *looking.near(self._stage, index, shape, goal, was, self._reach))
