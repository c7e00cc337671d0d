"""A cable that is wound up by a gripper meets itself, and is not passed through: the loop of the environment against link and balance."""

from __future__ import annotations

import time
from contextlib import closing
from dataclasses import replace
from functools import cache
from typing import cast

import numpy as np
import pytest
from in_process import steps

from env_server.asking import Asker
from env_server.loop import Loop
from env_server.self_boundary import meet
from env_server.stage import Stage
from env_server.stepped import Stepped
from protocol.errors import MessageError
from protocol.kinds import Outcome, SelfInteraction
from protocol.messages import Problem, SelfContacts, ShapeReply, ShapeRequest
from protocol.scene import Cable, Gripper, Move, Scene, Target
from shape_server.link import writhe
from shape_server.numpy_path import directors
from shape_server.paths import Paths
from shape_server.solve import answer

DIAMETER, CHORD = 0.012, 0.45  # m
QUARTERS = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0))
FAR = 10.0  # m


class Direct:
    """Answers requests in this process, in the place of an `Asker`."""

    coding = 0.0

    def __init__(self) -> None:
        self.asked: list[ShapeRequest] = []
        self.path = Paths("numpy").current

    def send(self, request: ShapeRequest) -> None:
        """Keep the request."""
        self.asked.append(request)

    def receive(self) -> ShapeReply:
        """Its answer."""
        request, begun = self.asked[-1], time.perf_counter()
        shapes = tuple(answer(problem, request, self.path) for problem in request.problems)
        busy = time.perf_counter() - begun
        return ShapeReply(session=request.session, step=request.step, round=request.round, shapes=shapes, busy=busy)


def wound(kind: SelfInteraction) -> Scene:
    """A cable of 1 m between two grippers, one of which turns about it by a turn and three quarters."""
    cable = Cable(name="c", length=1.0, diameter=DIAMETER, mass_per_length=0.02, bending=1e-2, twist=8e-3, self_interaction=kind)
    grippers = (
        Gripper(name="left", cable="c", at=0.0, position=(0.0, 0.0, 0.0), tangent=(1.0, 0.0, 0.0)),
        Gripper(name="right", cable="c", at=1.0, position=(CHORD, 0.0, 0.0), tangent=(1.0, 0.0, 0.0)),
    )
    moves = tuple(
        Move(name=f"quarter {k}", duration=1.0, targets=(Target(gripper="right", approach=approach),))
        for k, approach in enumerate(QUARTERS)
    )
    return Scene(title="t", cables=(cable,), grippers=grippers, moves=moves, time_step=0.1, tolerance=5e-3)


@cache
def play(kind: SelfInteraction) -> tuple[list[Stepped], list[ShapeRequest]]:
    """All steps, and what was asked."""
    direct = Direct()
    with closing(Stage(wound(kind), lambda _: None)) as stage:
        loop = Loop(stage, cast(Asker, direct), "s")
        steps = [loop.first()]
        for step in range(1, len(stage.path.times)):
            steps.append(loop.advance(step))
            assert steps[-1].cables[0].shape.outcome is Outcome.CONVERGED, steps[-1].cables[0].shape.sentence
    return steps, direct.asked


def link(step: Stepped) -> float:
    """Twist and writhe [turns] of the cable, led on far along the tangents of its ends and closed."""
    shape = step.cables[0].shape
    tangents = directors(shape.frames)[:, 2]
    closed = np.vstack([shape.nodes[0] - FAR * tangents[0], shape.nodes, shape.nodes[-1] + FAR * tangents[-1], [0.0, 0.0, FAR]])
    return shape.total_twist / (2 * np.pi) + writhe(closed)


@pytest.mark.slow
def test_a_cable_that_is_wound_up_ends_in_contact_with_itself() -> None:
    steps, _ = play(SelfInteraction.CONTACT)
    own = steps[-1].cables[0].own
    assert own is not None
    push = np.linalg.norm(own.reactions.force, axis=1)
    assert push.sum() > 0.3  # N; measured 0.8
    at = own.reactions.s[np.argmax(push)]
    shape = steps[-1].cables[0].shape
    first, second = (np.array([np.interp(s, shape.s, column) for column in shape.nodes.T]) for s in at)
    assert np.linalg.norm(first - second) == pytest.approx(DIAMETER, abs=5e-4)  # m; the smooth axis runs inside the polygon


@pytest.mark.slow
def test_strands_never_pass_through_each_other() -> None:
    """Link changes by two turns when they do, and otherwise only as far as the gripper turns."""
    steps, _ = play(SelfInteraction.CONTACT)
    links = np.array([link(step) for step in steps])
    assert np.abs(np.diff(links)).max() < 1.0  # measured 0.5: the closed polygon has edges in line, worth a quarter of a turn
    assert links[-1] - links[0] == pytest.approx(1.75, abs=0.5)
    depth = max(step.cables[0].own.candidates.penetration for step in steps if step.cables[0].own is not None)
    assert depth < 5e-4  # m, of the polygon; the smooth axis is 1e-7 m deep at most


@pytest.mark.parametrize("time_step", [0.25, 0.4, 1.0])
def test_in_larger_steps_strands_do_not_pass_through_each_other_either(time_step: float) -> None:
    """A quarter of a turn and more in a step: on the way the cable snaps into a loop that touches itself."""
    played = [step for _, step in steps(replace(wound(SelfInteraction.CONTACT), time_step=time_step))]
    assert played[-1].cables[0].shape.outcome is Outcome.CONVERGED
    links = [link(step) for step in played]
    assert np.abs(np.diff(links)).max() < 1.0  # measured 0.62
    assert links[-1] - links[0] == pytest.approx(1.75, abs=0.5)


@pytest.mark.thorough
def test_a_transparent_cable_is_not_looked_at_and_asks_about_nothing() -> None:
    steps, asked = play(SelfInteraction.TRANSPARENT)
    assert all(step.cables[0].own is None for step in steps)
    assert all(problem.self_contacts is None for request in asked for problem in request.problems)
    assert all(step.cables[0].shape.self_reactions is None for step in steps)


@pytest.mark.slow
def test_rows_are_asked_about_only_where_the_cable_is_near_itself() -> None:
    _, asked = play(SelfInteraction.CONTACT)
    rows = [0 if request.problems[0].self_contacts is None else len(request.problems[0].self_contacts.s) for request in asked]
    assert rows[0] == 0
    assert 0 < rows[-1] < 12


@pytest.mark.thorough
def test_a_push_is_handed_on_to_the_row_that_is_nearest() -> None:
    steps, _ = play(SelfInteraction.CONTACT)
    cable = steps[-1].cables[0]
    assert cable.own is not None
    near = meet(wound(SelfInteraction.CONTACT).cables[0], cable.shape, 0.05)
    assert near is not None
    again = near.contacts(cable.shape.s)
    assert isinstance(again, SelfContacts)
    np.testing.assert_allclose(
        np.linalg.norm(again.force, axis=1).sum(), np.linalg.norm(cable.own.reactions.force, axis=1).sum(), rtol=1e-9
    )


@pytest.mark.parametrize(
    ("kind", "more", "words"),
    [
        (SelfInteraction.BOND, {"stretch": 100.0}, "'bond' of a cable that stretches is not built"),
        (SelfInteraction.FICTITIOUS, {}, "needs 'bend_radius'"),
        (SelfInteraction.CONTACT, {"bending": None, "twist": None}, "needs a cable with 'bending'"),
        (SelfInteraction.CONTACT, {"stretch": 100.0}, "stretches is not built"),
    ],
)
def test_what_is_not_built_is_refused_with_a_sentence(kind: SelfInteraction, more: dict[str, float | None], words: str) -> None:
    given = {"bending": 1e-2, "twist": 8e-3, **more}
    cable = Cable(name="c", length=1.0, diameter=DIAMETER, mass_per_length=0.02, self_interaction=kind, **given)
    with pytest.raises(MessageError, match=words):
        Problem(cable=cable, grasps=play(SelfInteraction.TRANSPARENT)[1][0].problems[0].grasps)
