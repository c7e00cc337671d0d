"""A pressed column gives way: Euler 1759, from the stability margin.

Source: Euler 1759, "Sur la force des colonnes", Memoires de l'academie des sciences de Berlin 13, 252-282; Timoshenko & Gere 1961,
"Theory of elastic stability", 2nd ed., secs. 2.1 to 2.3.

Claim: a straight column of 1 m with EI = 1 N m^2 gives way at pi^2 / 4 (free top), pi^2 (hinges), 20.19 (clamp and hinge, the first
root of tan x = x) and 4 pi^2 (clamps) newtons. Turned by theta it stores int (EI theta'^2 - P theta^2) / 2, so the margin, which is
the smallest stiffness against turning over length, is P_cr - P. Checked by counting the eigenvalues of a polygon of 400 links.
Between fixed ends the column has to shorten to be pressed: with the strain P / EA the load turns a shorter link, and P becomes
P (1 - P / EA); with EA = 1e6 N that is 4e-5 of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from loaded import answer, pose, straight
from posed import cable, frame, grasps
from scipy.linalg import eigvalsh, null_space
from scipy.optimize import brentq

from protocol.kinds import Hold, Outcome
from protocol.messages import Shape

ALONG = frame((1.0, 0.0, 0.0))
SEGMENTS = 200
STRETCH = 1e6  # N
COLUMN = cable(bending=1.0, twist=50.0, weight=0.0)  # stiff in twist: bending alone decides


@dataclass(frozen=True)
class Ends:
    """How a column is held, and when it gives way."""

    hold: tuple[Hold | None, Hold | None]
    critical: float  # N


CASES = {
    "free top": Ends((Hold.CLAMP, None), np.pi**2 / 4),
    "guided top": Ends((Hold.CLAMP, Hold.GUIDE), 4 * np.pi**2),
    "clamps": Ends((Hold.CLAMP, Hold.CLAMP), 4 * np.pi**2),
    "clamp and hinge": Ends((Hold.CLAMP, Hold.HINGE), brentq(lambda x: np.tan(x) - x, 4.3, 4.6, xtol=1e-14) ** 2),
    "hinges": Ends((Hold.HINGE, Hold.HINGE), np.pi**2),
}
each_case = pytest.mark.parametrize("name", CASES)


def pressed(name: str, part: float) -> Shape:
    """Pressed by a `part` of the critical force: by a dead load where the top can move, else by what the ends are nearer."""
    ends = CASES[name]
    force = part * ends.critical
    rows = [(0.0, (0.0, 0.0, 0.0), ALONG, ends.hold[0])]
    push = np.array([[force, 0.0, 0.0], [0.0, 0.0, 0.0]])
    if ends.hold[1] in (None, Hold.GUIDE):
        rows += [(1.0, (1.0, 0.0, 0.0), ALONG, Hold.GUIDE)] * (ends.hold[1] is Hold.GUIDE)
        start = straight(1.0, SEGMENTS, ALONG, push[: len(rows)])
        return answer(pose(COLUMN, grasps(*rows), (1.0, (-force, 0.0, 0.0)), start=start), extrapolate=False, margin=True)
    rows.append((1.0, (1.0 - force / STRETCH, 0.0, 0.0), ALONG, ends.hold[1]))
    start = straight(1.0, SEGMENTS, ALONG, np.array([push[0], -push[0]]))
    return answer(pose(replace(COLUMN, stretch=STRETCH), grasps(*rows), start=start), extrapolate=False, margin=True)


@each_case
def test_a_polygon_has_the_same_critical_force(name: str) -> None:
    """Link angles with EI (difference)^2 / h; between fixed ends, or under a guide, their sum is zero."""
    ends, count = CASES[name], 400
    first, last = (2.0 if hold in (Hold.CLAMP, Hold.GUIDE) else 0.0 for hold in ends.hold)
    stiffness = 2 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1)
    stiffness[0, 0], stiffness[-1, -1] = 1.0 + first, 1.0 + last
    free = np.eye(count) if ends.hold[1] is None else null_space(np.ones((1, count)))
    smallest = eigvalsh(free.T @ stiffness @ free * count**2, subset_by_index=[0, 0])[0]
    assert smallest == pytest.approx(ends.critical, rel=2e-4)


@each_case
@pytest.mark.parametrize("part", [0.95, 0.99, 0.999])
def test_the_margin_is_what_is_left_of_the_critical_force(name: str, part: float) -> None:
    shape, critical = pressed(name, part), CASES[name].critical
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert shape.is_stable
    assert np.abs(shape.nodes[:, 1:]).max() < 1e-9  # m
    assert shape.margin is not None
    assert (shape.margin + part * critical) / critical == pytest.approx(1.0, abs=1e-3)


@each_case
@pytest.mark.parametrize("part", [1.0005, 1.001, 1.003, 1.01, 1.05])
def test_a_column_pressed_harder_is_never_called_stable_and_straight(name: str, part: float) -> None:
    shape = pressed(name, part)
    assert shape.outcome is not Outcome.CONVERGED or np.hypot(*shape.nodes[:, 1:].T).max() > 1e-5, shape.sentence
