"""Snaps are found in real ones, in steps of any length; and in nothing that is only fast."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from functools import partial
from typing import cast

import msgspec
import numpy as np
import pytest
from in_process import Direct, steps
from test_paper_figures import go
from test_paper_figures import scene as figure
from test_relaxation import CABLE, FREE, STILL, posture_of

import scenarios
from env_server.asking import Asker
from env_server.boundary import Boundary
from env_server.hanging import Hanging
from env_server.loop import Loop
from env_server.snap import HALVINGS, NOTICED, farthest, has_snapped
from env_server.stage import Posture, Stage
from env_server.stepped import Stepped
from protocol.kinds import Friction, Outcome
from protocol.scene import Move, Scene, Target

ARCH = scenarios.load("paper/fig_17_arch")
PEG = scenarios.load("paper/fig_17_lost")


def snaps(scene: Scene) -> list[tuple[Stepped, Stepped]]:
    """Steps of a scene in which its cable has snapped: before and after."""
    found = []
    with closing(Stage(scene, lambda _: None)) as stage:
        loop = Loop(stage, cast(Asker, Direct()), "test")
        before = loop.first()
        for step in range(1, stage.path.steps + 1):
            after = loop.advance(step)
            assert after.cables[0].shape.outcome is Outcome.CONVERGED, after.cables[0].shape.sentence
            if has_snapped(stage, partial(loop.tried, step), before, after, 0):
                found.append((before, after))
            before = after
    return found


@pytest.mark.parametrize("time_step", [pytest.param(0.05, marks=pytest.mark.slow), 0.2])
def test_an_arch_that_is_turned_past_its_fold_snaps_once(time_step: float) -> None:
    ((before, after),) = snaps(replace(ARCH, time_step=time_step))
    heights = [step.cables[0].shape.nodes[len(step.cables[0].shape.nodes) // 2, 2] for step in (before, after)]
    assert heights[0] > 1.05
    assert heights[1] < 0.9
    assert before.posture.time < 0.71 <= after.posture.time  # s, of the fold


@pytest.mark.parametrize("time_step", [pytest.param(0.05, marks=pytest.mark.slow), 0.2])
def test_a_cable_whose_peg_is_drawn_out_snaps_once(time_step: float) -> None:
    ((before, after),) = snaps(replace(PEG, time_step=time_step, tolerance=5e-3))
    assert len(before.cables[0].boundary.pushes.s)
    assert not len(after.cables[0].boundary.pushes.s)
    assert farthest(before.cables[0].shape, after.cables[0].shape) > 0.1


def test_a_loop_that_is_drawn_open_smoothly_does_not_snap() -> None:
    """It goes out of its plane, 15 times as fast as its ends go; in steps short enough it does so by and by."""
    assert not snaps(replace(scenarios.load("paper/fig_13_crossing"), time_step=0.04))


@pytest.mark.thorough
def test_a_cable_that_slides_over_an_obstacle_does_not_snap() -> None:
    """Fig. 5 on the way to P and to Q: up to 0.3 m of slack run over, but no faster than the obstacle drives it."""
    assert not snaps(figure((3.5, -7.0), Friction.NONE, go("to P", 0.2, o=(0.0, 2.2)), go("to Q", 0.2, o=(0.0, 0.8))))


def test_a_taut_cable_that_is_let_go_sinks_fast_but_does_not_snap() -> None:
    """Its sag goes with the root of the way of its end: ten times as far as that."""
    taut = replace(STILL.grippers[1], position=(1.2 * (1.0 - 1e-7), 0.0, 1.0))
    let_go = Move(name="m", duration=0.05, targets=(Target(gripper="right", by=(-4e-3, 0.0, 0.0)),))
    scene = replace(STILL, grippers=(STILL.grippers[0], taut), moves=(let_go,), tolerance=1e-4)
    *_, (_, last) = steps(scene)
    assert np.ptp(last.cables[0].shape.nodes[:, 2]) > 1.5 * NOTICED * CABLE.length
    assert not snaps(scene)


def test_what_follows_its_grippers_is_not_looked_into() -> None:
    asked = []

    def tried(posture: Posture, before: Stepped) -> Stepped:
        asked.append(posture.time)
        return replace(before, posture=posture)

    with closing(Stage(STILL, lambda _: None)) as stage:
        before, near, far = (posture_of(stage, step, (x, 0.0, -9.81)) for step, x in ((0, 0.0), (1, 0.01), (1, 3.0)))
        assert not has_snapped(stage, tried, before, near, 0)
        assert not asked
        assert has_snapped(stage, tried, before, far, 0)
        assert len(asked) == HALVINGS


def test_where_no_shape_is_found_on_the_way_none_was_gone_through() -> None:
    def tried(posture: Posture, before: Stepped) -> Stepped:
        nothing = Hanging(before.cables[0].shape, Boundary(0.005, 1.2, np.zeros(0, dtype=bool)), *2 * (before.cables[0].bodies,))
        return Stepped(posture, (replace(nothing, shape=unfound),), 1, (), FREE)

    with closing(Stage(STILL, lambda _: None)) as stage:
        before, far = (posture_of(stage, step, (x, 0.0, -9.81)) for step, x in ((0, 0.0), (1, 3.0)))
        unfound = msgspec.structs.replace(before.cables[0].shape, outcome=Outcome.NOT_CONVERGED, sentence="not found")
        assert has_snapped(stage, tried, before, far, 0)
