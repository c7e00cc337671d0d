"""Turning, moving, mirroring, other units and reversing change nothing but that: random problems, free and in contact, smooth and rough.

Each image starts from the image of the start, and must come to the image of the shape.
"""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from images import Image
from rods import GRAVITY, RADIUS, Row, cable, contacts, frame, grasps, start_from
from scipy.spatial.transform import Rotation

from protocol.kinds import Feature, Friction, Model, Outcome
from protocol.messages import Contacts, FrictionLaw, Problem, Shape
from shape_server import kernels, solve
from shape_server.hard_cases.posing import rubbing

LAWS = {
    Friction.SIGNUM: FrictionLaw(coefficient=0.4),
    Friction.REGULARIZED: FrictionLaw(coefficient=0.4, speed=0.03),
}
# Of the length, and of the largest force. Measured 1.4e-7 and 5e-5 with another unit of length, for a contact gives by 1e-7 m, which is no
# share of the length; without, 8e-8 where it rubs and 4e-10 where it does not; and 1e-13 where nothing is touched.
NODES, FORCES = 5e-7, 2e-4
FREE = 1e-10
# A contact gives by some 1e-7 m however long the cable is, which a cable of centimetres feels: 1e-6 of 3 cm, and 2e-4 of the force.
SMALLEST = -0.5  # power of ten of the length [m]

images = st.one_of(
    st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)).map(lambda v: Image(turn=Rotation.from_rotvec(v))),
    st.tuples(st.floats(-100.0, 100.0), st.floats(-100.0, 100.0), st.floats(-100.0, 100.0)).map(lambda v: Image(shift=v)),
    st.just(Image(is_mirrored=True)),
    st.just(Image(is_reversed=True)),
    st.tuples(st.floats(SMALLEST, 3.0), st.floats(-3.0, 3.0)).map(lambda p: Image(length=10 ** p[0], force=10 ** p[1])),
    st.tuples(st.floats(-3.0, 3.0), st.floats(SMALLEST, 2.0), st.booleans()).map(
        lambda p: Image(Rotation.from_rotvec([p[0], 1.0, p[1]]), (p[1], 1.0, p[0]), p[2], 10 ** p[1], 10 ** -p[1], not p[2])
    ),
)
seeds = st.integers(0, 10_000)


def held(rng: np.random.Generator) -> Problem:
    """Two clamps at 0.4 to 0.9 of the length from each other, not far from level."""
    bending, chord = float(10 ** rng.uniform(-3, -1.5)), float(rng.uniform(0.4, 0.9))
    ends = [frame((1.0, *rng.uniform(-0.5, 0.5, 2))) for _ in range(2)]
    last = (chord, float(rng.uniform(-0.05, 0.05)), float(rng.uniform(-0.05, 0.05)))
    return Problem(cable=cable(bending=bending), grasps=grasps((0.0, (0, 0, 0), ends[0]), (1.0, last, ends[1])), model=Model.ROD)


def found(problem: Problem, gravity: tuple[float, float, float] = GRAVITY) -> Shape:
    return solve(problem, gravity, tolerance=1e-3 * problem.cable.length, extrapolate=False, path=kernels)


def touching(rng: np.random.Generator, free: Shape, law: FrictionLaw | None, kind: Friction) -> Contacts:
    """A floor, or an edge across, that comes up under the cable; with friction every place was a little aside before."""
    rise, rows = float(rng.uniform(1e-3, 2e-2)), []
    if rng.random() < 0.6:
        low = float(free.nodes[:, 2].min()) + rise - RADIUS
        rows = [Row(s=float(s), point=(0.0, 0.0, low)) for s in free.s[3:-3]]
    else:
        s = float(rng.uniform(0.3, 0.7))
        at = np.array([np.interp(s, free.s, column) for column in free.nodes.T])
        rows = [Row(s=s, point=at + np.array([0.0, 0.0, rise - RADIUS]), direction=(0.0, 1.0, 0.0), feature=Feature.EDGE)]
    plain = contacts(*rows)
    if law is None:
        return plain
    there = np.column_stack([np.interp(plain.s, free.s, column) for column in free.nodes.T])
    return rubbing(plain, kind, law, there + np.array([*rng.uniform(-2e-3, 2e-3, 2), 0.0]))


def compare(problem: Problem, image: Image) -> None:
    """The image of the problem has the image of its shape, or is refused as it is."""
    shape = found(problem)
    seen = found(image.problem(problem), image.gravity(GRAVITY))
    assert seen.outcome is shape.outcome, (shape.sentence, seen.sentence)
    if shape.outcome is Outcome.CONVERGED:
        nodes, forces = image.off(shape, seen)
        assert nodes < (FREE if problem.contacts is None else NODES)
        assert forces < (FREE if problem.contacts is None else FORCES)


@settings(max_examples=15)
@given(seed=seeds, image=images)
def test_a_free_cable_knows_no_place_direction_unit_or_end(seed: int, image: Image) -> None:
    problem = held(np.random.default_rng(seed))
    free = found(problem)
    compare(msgspec.structs.replace(problem, start=start_from(free)), image)


@pytest.mark.parametrize("kind", [Friction.NONE, *LAWS])
@settings(max_examples=15)
@given(seed=seeds, image=images)
def test_a_cable_in_contact_knows_no_place_direction_unit_or_end(kind: Friction, seed: int, image: Image) -> None:
    rng = np.random.default_rng(seed)
    problem = held(rng)
    free = found(problem)
    rows = touching(rng, free, LAWS.get(kind), kind)
    compare(msgspec.structs.replace(problem, start=start_from(free), contacts=rows), image)
