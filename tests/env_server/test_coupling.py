"""What one more round of shape and contacts would change at the end of a step: said beforehand, and then tried."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from in_process import Direct
from scipy.interpolate import CubicSpline

import scenarios
from env_server import coupling
from env_server.asking import Asker
from env_server.hanging import Hanging
from env_server.loop import Loop
from env_server.stage import Posture, Stage
from protocol.kinds import Outcome
from protocol.messages import Problem, Shape
from protocol.scene import Scene

FLOOR = 1e-7  # of the length; changes below it count as that: the shape server lets contacts miss by as much


class Watched(Loop):
    """Keeps how every attempt at a step ended, before anything is made of it."""

    ended: dict[tuple[float, ...], tuple[Sequence[Hanging], Posture]]

    def _coupling(self, cables: Sequence[Hanging], asked: Sequence[Problem], goal: Posture) -> tuple[float, ...]:
        said = super()._coupling(cables, asked, goal)
        self.ended = (self.ended if hasattr(self, "ended") else {}) | {said: (cables, goal)}
        return said

    def once_more(self, said: tuple[float, ...]) -> list[float]:
        """How far [m] each cable goes when its contacts are looked at once more, and its shape is asked for again."""
        cables, goal = self.ended[said]
        self.ended = {}
        grasps = [self._stage.grasps(cable.name, goal) for cable in self._stage.scene.cables]
        problems = self._problems(goal, cables, grasps, None)
        shapes, _ = self._ask(0, problems, None, goal, has_moved_robot=True)
        return [apart(was.shape, now) if now.outcome is Outcome.CONVERGED else np.inf for was, now in zip(cables, shapes, strict=True)]


def apart(was: Shape, now: Shape) -> float:
    """Largest distance [m] between nodes at the same arc length; those that follow a bend along the cable are left out."""
    near = np.clip(np.searchsorted(now.s, was.s - 1e-12), 0, len(now.s) - 1)
    same = np.abs(now.s[near] - was.s) < 1e-11
    return float(np.linalg.norm(was.nodes[same] - now.nodes[near[same]], axis=1).max())


def audited(scene: Scene, last: int | None = None) -> Iterator[tuple[float, float]]:
    """What one more round was said to change and what it changed, over the length, for every cable at every step."""
    with closing(Stage(scene, lambda _: None)) as stage:
        loop = Watched(stage, cast(Asker, Direct()), "test")
        for step in range((stage.path.steps if last is None else last) + 1):
            stepped = loop.advance(step) if step else loop.first()
            assert len(stepped.coupling) == len(scene.cables)
            for cable, said, true in zip(scene.cables, stepped.coupling, loop.once_more(stepped.coupling), strict=True):
                yield said / cable.length, true / cable.length


def judged(pairs: Sequence[tuple[float, float]]) -> tuple[float, float, int]:
    """Coverage, median over-estimate, and how many changes were above the floor."""
    said, true = np.maximum(np.array(pairs).T, FLOOR)
    return float((true <= said).mean()), float(np.median(said / true)), int((true > FLOOR).sum())


def test_a_beam_goes_along_with_its_supports() -> None:
    """Against scipy's cubic splines; the largest deflection is looked for at seven places of every span, here at two thousand."""
    at, by, s = np.array([0.0, 0.31, 0.33, 0.7, 1.0]), np.array([0.0, 1e-5, 0.0, -2e-6, 0.0]), np.linspace(0.0, 1.0, 2001)
    for is_clamped, kind in ((True, "clamped"), (False, "natural")):
        clamps = np.array([is_clamped, False, False, False, is_clamped])
        exact = np.abs(CubicSpline(at, by, bc_type=kind)(s)).max()
        found = coupling._deflection(at, by, clamps, (0.0, 1.0))
        assert found <= exact
        assert found == pytest.approx(exact, rel=0.02)  # measured 0.3 % and 0.2 % below


def test_a_support_beside_another_one_swings_the_free_span() -> None:
    """A slope of d / a at the end of a span l, the other end clamped, deflects it by 4/27 l d / a."""
    near, span, shift = 1e-3, 0.5, 1e-6
    at, by = np.array([0.0, span, span + near, span + 2 * near]), np.array([0.0, 0.0, shift, 2 * shift])
    found = coupling._deflection(at, by, np.eye(4, dtype=bool)[0], (0.0, span + 2 * near))
    assert found == pytest.approx(4 / 27 * span * shift / near, rel=0.03)  # measured 1.6 % less


def test_a_cable_that_touches_nothing_would_change_by_what_its_residual_says() -> None:
    wrenches = np.zeros((2, 6))
    wrenches[:, 2] = 0.5
    shape = cast(Shape, SimpleNamespace(s=np.array([0.0, 2.0]), grasp_wrenches=wrenches, residual=1e-9))
    assert coupling._left(shape) == pytest.approx(2.0 * coupling.GIVES * 1e-9 / 0.5)
    rough = cast(Shape, SimpleNamespace(s=shape.s, grasp_wrenches=wrenches, residual=1e-2))
    assert coupling._left(rough) == 2.0 * coupling.LEFT


def test_the_harness_says_what_one_more_round_would_change_while_it_comes_to_lie_on_the_dashboard() -> None:
    """In steps 116 to 122 supports on facets take turns; where that is more than the tolerance leaves the step goes on, and settles."""
    pairs = list(audited(scenarios.load("harness_assembly"), last=124))
    coverage, pessimism, _ = judged(pairs)
    assert coverage >= 0.95  # measured 1.0
    assert pessimism <= 3.0  # measured 1.0
    said, true = pairs[122]
    assert 3e-5 < true <= said <= 5 * true  # over 1.2 m; measured 3.7e-5, 1.4 times
    for said, true in (pairs[116], pairs[120]):
        assert true <= said < 1e-9  # 2e-4 without the rounds more; measured 6e-14 and 2e-13


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("name", ["harness_assembly", "case_study_1"])
def test_what_one_more_round_changes_is_below_what_was_said(name: str) -> None:
    pairs = list(audited(scenarios.load(name)))
    coverage, pessimism, above = judged(pairs)
    assert coverage >= 0.95
    assert pessimism <= 3.0
    assert above > 40
    moved = [(said, true) for said, true in pairs if true > FLOOR]
    coverage, pessimism, _ = judged(moved)
    assert coverage >= 0.95
    assert pessimism <= 3.0
