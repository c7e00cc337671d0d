"""A step that never settles says why: two strands deep in each other were on their way to a shape that only passing through would reach."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from test_relaxation import STILL, posture_of

from env_server.hanging import DEEP, THROUGH, unsettled
from env_server.self_boundary import NO_REACTIONS, Meeting
from env_server.self_touch import SelfCandidates, search
from env_server.stage import Stage
from protocol.kinds import Outcome

RADIUS, SENTENCE = 0.005, "the contacts did not settle in 6 rounds"


def crossing(apart: float) -> SelfCandidates:
    """A figure of eight of 1.2 m, its strands `apart` [m] where they cross."""
    turn = np.linspace(-0.4 * np.pi, 1.4 * np.pi, 200)
    nodes = np.column_stack([0.2 * np.sin(turn), 0.1 * np.sin(2.0 * turn), 0.5 * apart * np.cos(turn)])
    s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(nodes, axis=0), axis=1)))
    return search(nodes, s, RADIUS, 0.01, 0.01)


@pytest.mark.parametrize(("apart", "is_through"), [(0.0004, True), (0.0074, True), (0.0076, False), (0.012, False)])
def test_strands_deep_in_each_other_are_told_as_such(apart: float, *, is_through: bool) -> None:
    found = crossing(apart)
    assert (found.penetration > DEEP * RADIUS) == is_through
    with closing(Stage(STILL, lambda _: None)) as stage:
        cable = posture_of(stage, 0, (0.0, 0.0, -9.81)).cables[0]
    (left,) = unsettled((replace(cable, own=Meeting(RADIUS, found, NO_REACTIONS)),), SENTENCE)
    assert left.shape.outcome is Outcome.NOT_CONVERGED
    assert left.shape.sentence == (THROUGH if is_through else SENTENCE)


def test_a_cable_without_a_shape_keeps_its_own_reason() -> None:
    with closing(Stage(STILL, lambda _: None)) as stage:
        cable = posture_of(stage, 0, (0.0, 0.0, -9.81)).cables[0]
    (told,) = unsettled((cable,), "first")
    assert unsettled((told,), "second") == (told,)
