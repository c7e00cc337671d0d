"""Whatever the cable has and however it is held, forces and moments on the whole of it sum to zero: Euler 1775.

Source: Euler 1775, "Nova methodus motum corporum rigidorum determinandi", Novi commentarii academiae scientiarum Petropolitanae
20, 208-238.

Claim: to 1e-9 of the largest force, and of that times the length, for every effect of the rod and for clamps, hinges and free
ends, on coarse and on combined meshes. The sum is taken from the answer alone: nodes, wrenches of the grasps, and the weights and
loads that were asked for; where two meshes are combined, by Simpson's rule over the nodes. A cable that only hinges hold, in one line or
one point, can swing about them: there its own shape has to balance, no wrench can.
The sum itself is checked on a see-saw.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from loaded import answer, pose, straight, unbalanced
from posed import G, cable, frame, grasps

from protocol.cable import Cable, LumpedMass, Section
from protocol.kinds import Hold, Outcome

FIRST, LAST = frame((0.8, 0.5, 0.2)), frame((0.3, -0.6, 0.5), roll=1.0)
ORIGIN, MIDDLE, END = (0.0, 0.0, 0.0), (0.35, 0.1, 0.1), (0.6, 0.2, 0.1)  # m
PLAIN = cable(bending=0.05, twist=0.03)
RODS: dict[str, Cable] = {
    "plain": PLAIN,
    "soft": cable(bending=1e-5, twist=1e-5),
    "stretch": replace(PLAIN, stretch=20.0),
    "two axes": replace(PLAIN, bending_2=0.15),
    "natural curvature": replace(PLAIN, natural_curvature=(1.0, -2.0, 1.5)),
    "sections": replace(PLAIN, sections=(Section(start=0.3, end=0.62, bending=5.0, mass_per_length=0.5),)),
    "masses": replace(PLAIN, masses=(LumpedMass(0.4, 0.5 / G), LumpedMass(0.77, 0.1 / G))),
    "all": replace(
        PLAIN,
        stretch=20.0,
        bending_2=0.15,
        natural_curvature=(1.0, -2.0, 1.5),
        sections=(Section(start=0.3, end=0.62, bending=0.5, mass_per_length=0.5),),
        masses=(LumpedMass(0.4, 0.5 / G),),
    ),
}
HELD = {
    "clamps": grasps((0.0, ORIGIN, FIRST, Hold.CLAMP), (1.0, END, LAST, Hold.CLAMP)),
    "clamp and hinge": grasps((0.0, ORIGIN, FIRST, Hold.CLAMP), (1.0, END, LAST, Hold.HINGE)),
    "free end": grasps((0.0, ORIGIN, FIRST, Hold.CLAMP)),
    "two hinges": grasps((0.0, ORIGIN, FIRST, Hold.HINGE), (1.0, END, LAST, Hold.HINGE)),
    "three hinges in a line": grasps(
        (0.0, ORIGIN, FIRST, Hold.HINGE), (0.4, (0.18, 0.06, 0.03), FIRST, Hold.HINGE), (0.95, END, LAST, Hold.HINGE)
    ),
    "two hinges inside": grasps((0.2, ORIGIN, FIRST, Hold.HINGE), (0.85, (0.5, 0.1, 0.1), LAST, Hold.HINGE)),
    "one hinge": grasps((0.3, ORIGIN, FIRST, Hold.HINGE)),
    "three": grasps((0.0, ORIGIN, FIRST, Hold.CLAMP), (0.5, MIDDLE, FIRST, Hold.HINGE), (0.9, END, LAST, Hold.CLAMP)),
}


def test_the_sum_of_a_see_saw_is_what_its_loads_leave() -> None:
    """A level rod of no weight held in the middle: two equal loads balance, and the answer must not need a moment."""
    level = frame((1.0, 0.0, 0.0))
    held = grasps((0.5, (0.5, 0.0, 0.0), level, Hold.CLAMP))
    loads = ((0.0, (0.0, 0.0, -0.1)), (1.0, (0.0, 0.0, -0.1)))
    problem = pose(cable(bending=1.0, weight=0.0), held, *loads, start=straight(1.0, 40, level, np.array([[0.0, 0.0, 0.2]])))
    shape = answer(problem, tolerance=1e-6)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert max(unbalanced(problem, shape)) < 1e-12
    uneven = pose(problem.cable, held, loads[0], (1.0, (0.0, 0.0, -0.2)))
    force, moment = unbalanced(uneven, shape)
    assert force == pytest.approx(0.1, abs=1e-9)  # of EI / L^2
    assert moment == pytest.approx(0.1 * shape.nodes[-1, 0], abs=1e-9)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
@pytest.mark.parametrize("held", HELD)
@pytest.mark.parametrize("name", RODS)
def test_forces_and_moments_sum_to_zero(name: str, held: str, tolerance: float) -> None:
    problem = pose(RODS[name], HELD[held], *([] if held == "three" else [(0.7, (0.05, -0.1, 0.1))]))
    shape = answer(problem, tolerance=tolerance)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert max(unbalanced(problem, shape)) < 1e-9
