"""The laws of friction, and the small system in which every contact opens, sticks or slides, checked against their definitions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from rods import GRAVITY, Row, cable, contacts, grasps

import shape_server.kernels as compiled
from protocol.errors import CablecosimError, MessageError
from protocol.kinds import Feature, Friction, Outcome
from protocol.messages import Contacts, FrictionLaw, FrictionTable, Problem
from shape_server import numpy_path, sensitivities, solve
from shape_server.contacts import numbers_of
from shape_server.effects import friction as effect
from shape_server.follower import Follower
from shape_server.hard_cases.posing import ALONG_X, RADIUS, rubbing, straight
from shape_server.mesh import even
from shape_server.rod import RUB, Rub

DT = 0.1  # s
TABLE = FrictionTable(
    speeds=np.array([0.0, 0.02, 0.1]), normals=np.array([1.0, 3.0]), forces=np.array([[0.5, 1.2], [0.3, 0.8], [0.4, 1.0]])
)
LAWS = {
    Friction.SIGNUM: FrictionLaw(coefficient=0.4),
    Friction.REGULARIZED: FrictionLaw(coefficient=0.4, speed=0.03),
    Friction.DEFINED: FrictionLaw(table=TABLE),
}
EVERY = pytest.mark.parametrize("kind", list(LAWS))


def rubs(count: int, kind: Friction, law: FrictionLaw) -> Rub:
    """Contacts with one law, for what depends on the law alone."""
    numbers = numbers_of(kind, law)
    rows = np.zeros(count, dtype=RUB)
    rows["coefficient"], rows["speed"], rows["table"] = numbers.coefficient, numbers.speed, -1 if numbers.table is None else 0
    return Rub(rows, effect._padded([] if numbers.table is None else [numbers.table]), DT)


def force(kind: Friction, speed: float, normal: float) -> float:
    """The law as it is written."""
    if kind is Friction.SIGNUM:
        return 0.4 * normal
    if kind is Friction.REGULARIZED:
        return 0.4 * normal * speed / np.hypot(speed, 0.03)
    columns = [np.interp(speed, TABLE.speeds, column) for column in TABLE.forces.T]
    if normal <= 1.0:
        return normal * columns[0]
    return columns[0] + (normal - 1.0) / 2.0 * (columns[1] - columns[0])


@EVERY
def test_a_law_is_what_its_equation_says_and_its_slopes_are_those_of_differences(kind: Friction) -> None:
    rub, step = rubs(1, kind, LAWS[kind]), 1e-6
    for speed in (0.005, 0.015, 0.05, 0.3):
        for normal in (0.2, 0.9, 2.0, 7.0):
            found, with_normal, with_speed = compiled.drag_limit(rub, 0, speed, normal)
            assert found == pytest.approx(force(kind, speed, normal), rel=1e-14)
            rise = (force(kind, speed, normal + step) - force(kind, speed, normal - step)) / (2 * step)
            slope = (force(kind, speed + step, normal) - force(kind, speed - step, normal)) / (2 * step)
            assert with_normal == pytest.approx(rise, abs=1e-8)
            assert with_speed == pytest.approx(slope, abs=1e-6)


def unlawful(kind: Friction, matrix: np.ndarray, right: np.ndarray, found: np.ndarray, sticks: np.ndarray, hard: float) -> float:
    """How far forces are from the laws of open, sticking and sliding contacts, over the largest force; from their definitions."""
    count = len(sticks)
    gap, normal, drag = matrix @ found - right, found[:count], found[count:].reshape(-1, 2)
    slip, wrong = gap[count:].reshape(-1, 2) - hard * drag, 0.0
    wrong = max(wrong, -normal.min(), float((np.abs(gap[:count]) * normal).max()), -float(gap[:count].min()))
    for k in range(count):
        size, limit = np.linalg.norm(slip[k]), force(kind, float(np.linalg.norm(slip[k])) / DT, float(normal[k]))
        if sticks[k]:
            wrong = max(wrong, np.linalg.norm(drag[k]) - force(kind, 0.0, float(normal[k])), np.linalg.norm(gap[count + 2 * k :][:2]))
        else:
            wrong = max(wrong, np.linalg.norm(drag[k] + limit * slip[k] / max(size, 1e-300)))
    return float(wrong / max(1e-9, float(np.abs(found).max())))


@EVERY
@pytest.mark.parametrize("path", [compiled, numpy_path], ids=["compiled", "numpy"])
def test_every_contact_of_a_random_system_is_open_sticks_or_slides_by_its_law(kind: Friction, path: object) -> None:
    rng, hard, lawful, states = np.random.default_rng(4), 1e-7, 0, set()
    problems = 300 if path is compiled else 30
    for _ in range(problems):
        count = int(rng.integers(1, 7))
        root = rng.normal(size=(3 * count, 3 * count + 2))
        matrix = root @ root.T / (3 * count) + hard * np.eye(3 * count)
        right = rng.normal(size=3 * count) + np.repeat([0.5, 0.0], [count, 2 * count])
        start = np.concatenate([np.maximum(rng.normal(size=count), 0.0), np.zeros(2 * count)])
        found, sticks, _ = path.stick_slip(matrix, right, np.arange(count), rubs(count, kind, LAWS[kind]), hard, start)
        lawful += unlawful(kind, matrix, right, found, sticks, hard) < 1e-6
        states |= {("open" if n == 0.0 else "sticks" if s else "slides") for n, s in zip(found[:count], sticks, strict=True)}
    assert states == ({"open", "slides"} if kind is Friction.REGULARIZED else {"open", "sticks", "slides"})
    assert lawful >= 0.99 * problems


@EVERY
@pytest.mark.parametrize("path", [compiled, numpy_path], ids=["compiled", "numpy"])
def test_contacts_that_say_the_same_share_the_force(kind: Friction, path: object) -> None:
    """Three on one straight segment: the gap of the middle one is the mean of the others, so that the matrix has no inverse."""
    count, hard = 3, 1e-7
    to_gaps = np.array([[1.0, 0.0], [0.5, 0.5], [0.0, 1.0]])
    matrix = np.zeros((3 * count, 3 * count))
    matrix[:count, :count] = to_gaps @ to_gaps.T
    for side in range(2):
        matrix[count + side :: 2, count + side :: 2] = to_gaps @ to_gaps.T + hard * np.eye(count)
    right = np.concatenate([to_gaps @ [1.0, 1.0], np.zeros(2 * count)])
    found, *_ = path.stick_slip(
        matrix, right, np.arange(count), rubs(count, kind, LAWS[kind]), hard, np.concatenate([np.ones(3), np.zeros(6)])
    )
    assert np.isfinite(found).all()
    np.testing.assert_allclose(matrix[:count] @ found, right[:count], atol=1e-9)


def test_contacts_of_a_cable_that_swings_freely_open_at_once_if_they_pull(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stiff cable on forty places of a floor, free to swing about one end: rounding makes half of them pull; none is to slide."""
    count, hard, rng, rounds = 40, 1e-7, np.random.default_rng(1), []
    s = np.arange(1, count + 1) / count
    near, far = np.minimum.outer(s, s), np.maximum.outer(s, s)
    flexibility = near**2 * (3 * far - near) / 6 + 1e12 * np.outer(s, s)
    matrix = hard * np.eye(3 * count)
    matrix[:count, :count] += flexibility
    matrix[count + 1 :: 2, count + 1 :: 2] += flexibility
    right = np.concatenate([flexibility @ np.full(count, 1 / count), 1e-16 * rng.normal(size=2 * count)])
    names = numpy_path.stick_slip.__globals__
    solved = names["_solved"]

    def counted(*given: Any) -> Any:
        rounds.append(given)
        return solved(*given)

    monkeypatch.setitem(names, "_solved", counted)
    rub = rubs(count, Friction.SIGNUM, LAWS[Friction.SIGNUM])
    found, *_ = numpy_path.stick_slip(matrix, right, np.arange(count), rub, hard, np.zeros(3 * count))
    assert found[:count] @ s == pytest.approx(s.sum() / count, rel=1e-9)  # moment about the hinge
    assert len(rounds) <= 8  # measured 6; 10 where they are let to slide


def rubs_on(rows: Sequence[Row], kind: Friction, law: FrictionLaw) -> Contacts:
    """Rows that rub by one law, held where they touch."""
    plain = contacts(*rows)
    return rubbing(plain, kind, law, plain.point + plain.distance[:, None] * plain.normal, DT)


def dragged(kind: Friction, law: FrictionLaw, by: tuple[float, float] = (1e-3, 5e-4), bending: float = 1e-3) -> Problem:
    """A cable that lies on a floor and is drawn by one end, in a direction of its own."""
    rows = [Row(s=float(s), point=(s, 0.0, 0.0)) for s in np.linspace(0.0, 1.0, 17)]
    held = contacts(*rows) if kind is Friction.NONE else rubs_on(rows, kind, law)
    end = grasps((1.0, (1.0 + by[0], by[1], RADIUS), ALONG_X))
    return Problem(cable=cable(bending=bending), grasps=end, contacts=held, start=straight(ALONG_X, 16, np.zeros((1, 3))))


@EVERY
def test_a_sliding_force_obeys_the_law_and_is_against_the_sliding(kind: Friction) -> None:
    problem = dragged(kind, LAWS[kind])
    shape = solve(problem, GRAVITY, path=compiled)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert shape.rubbed is not None
    assert not shape.rubbed.is_sticking.any()
    assert problem.contacts is not None
    slip = shape.nodes - np.column_stack([np.linspace(0, 1, 17), np.zeros(17), np.full(17, RADIUS)])
    for k in range(17):
        u, t, normal = slip[k, :2], shape.contact_forces[k, :2], float(shape.contact_forces[k, 2])
        expected = -force(kind, float(np.linalg.norm(u)) / DT, normal) * u / np.linalg.norm(u)
        np.testing.assert_allclose(t, expected, atol=2e-7)  # N, of 0.05 N at each; measured 5e-8


@pytest.mark.parametrize("kind", [Friction.SIGNUM, Friction.REGULARIZED])
def test_without_a_coefficient_there_is_no_friction_to_the_last_bit(kind: Friction) -> None:
    law = FrictionLaw(coefficient=0.0, speed=0.03 if kind is Friction.REGULARIZED else 0.0)
    bare, free = (solve(dragged(one, law), GRAVITY, path=compiled) for one in (kind, Friction.NONE))
    np.testing.assert_array_equal(bare.nodes, free.nodes)
    np.testing.assert_array_equal(bare.contact_forces, free.contact_forces)


@pytest.mark.parametrize("coefficient", [1e-9, 1e-3, 0.1, 1.0, 3.0, 10.0])
@pytest.mark.parametrize("kind", [Friction.SIGNUM, Friction.REGULARIZED])
def test_coefficients_from_none_to_ten_are_answered(kind: Friction, coefficient: float) -> None:
    law = FrictionLaw(coefficient=coefficient, speed=0.01 if kind is Friction.REGULARIZED else 0.0)
    shape = solve(dragged(kind, law), GRAVITY, path=compiled)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    tangential, normal = np.linalg.norm(shape.contact_forces[:, :2], axis=1), shape.contact_forces[:, 2]
    assert (tangential <= coefficient * normal + 1e-9).all()


def test_the_numpy_path_answers_as_the_compiled_one() -> None:
    for kind, law in LAWS.items():
        one, other = (solve(dragged(kind, law), GRAVITY, path=path) for path in (compiled, numpy_path))
        np.testing.assert_allclose(one.nodes, other.nodes, atol=1e-9)
        np.testing.assert_allclose(one.contact_forces, other.contact_forces, atol=1e-7)


def test_what_is_held_below_the_limit_stays_and_its_anchor_too() -> None:
    problem = dragged(Friction.SIGNUM, LAWS[Friction.SIGNUM], by=(0.0, 0.0))
    shape = solve(problem, GRAVITY, path=compiled)
    assert shape.rubbed is not None
    assert shape.rubbed.is_sticking[:-1].all()  # the gripper bears the last node
    assert problem.contacts is not None
    assert problem.contacts.rubbing is not None
    np.testing.assert_array_equal(shape.rubbed.anchor, problem.contacts.rubbing.anchor)


def test_an_edge_without_numbers_of_its_law_is_refused() -> None:
    row = Row(s=0.5, point=(0.5, 0.0, 0.0), direction=(0.0, 1.0, 0.0), feature=Feature.EDGE)
    end = grasps((1.0, (1.0, 0.0, RADIUS), ALONG_X))
    for kind, words in ((Friction.REGULARIZED, "needs v0"), (Friction.DEFINED, "needs a table")):
        with pytest.raises(MessageError, match=words):
            solve(Problem(cable=cable(), grasps=end, contacts=rubs_on([row], kind, FrictionLaw(coefficient=0.3))), GRAVITY)


def test_what_is_not_built_for_friction_says_so() -> None:
    problem = dragged(Friction.SIGNUM, LAWS[Friction.SIGNUM])
    shape = solve(problem, GRAVITY, path=compiled)
    with pytest.raises(CablecosimError, match="sensitivities are not built for contacts with friction"):
        sensitivities(problem, GRAVITY, shape)
    with pytest.raises(CablecosimError, match="a Follower is not built for contacts with friction"):
        Follower(problem, GRAVITY)


def test_a_cable_without_bending_is_dragged_by_a_tension_that_grows_with_what_lies_behind() -> None:
    """Mu w s, to within what one of the contacts bears."""
    stiff = dragged(Friction.SIGNUM, LAWS[Friction.SIGNUM])
    assert stiff.contacts is not None
    shape = solve(Problem(cable=cable(bending=None), grasps=stiff.grasps, contacts=stiff.contacts), GRAVITY, path=compiled)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    push = shape.contact_forces[:, 2]
    assert -shape.contact_forces[:, 0] == pytest.approx(0.4 * push, rel=5e-3)
    assert shape.grasp_wrenches[-1, 0] == pytest.approx(0.4 * push.sum(), rel=2e-3)  # measured 1.1e-3
    assert not shape.grasp_wrenches[:, 3:].any()


def test_the_rows_of_friction_change_with_turns_as_their_columns_say() -> None:
    from linear_model import build, look

    row = Row(s=0.43, point=(0.43, 0.0, 0.0), normal=(0.6, 0.0, 0.8))
    held = Problem(cable=cable(), grasps=grasps((0.0, (0.0, 0.0, 0.0), ALONG_X)), contacts=rubs_on([row], *next(iter(LAWS.items()))))
    system = build(held, GRAVITY)
    rng = np.random.default_rng(2)
    frames = numpy_path.retract(np.tile(ALONG_X, (len(system.mesh.lengths), 1)), rng.normal(scale=0.2, size=(len(system.mesh.lengths), 3)))
    state = system.start(frames)
    moved, view = look(system, state)
    carried, _, diagonal, _, _ = numpy_path.linear_system(system.rod, moved, view)
    border = numpy_path.border_rows(system.rod, moved, view, (0.0, 0.0), np.inf)
    columns = numpy_path.border_columns(system.rod, view, border, carried, diagonal)[:, :, -2:]
    turn, step = rng.normal(size=(len(frames), 3)), 1e-6
    slips = [look(system, state._replace(frames=numpy_path.retract(frames, sign * step * turn)))[1].slip[0] for sign in (1.0, -1.0)]
    np.testing.assert_allclose((slips[0] - slips[1]) / (2 * step), np.einsum("jka,jk->a", columns, turn), atol=1e-9)


def test_a_force_of_friction_turns_the_cable_as_its_column_says() -> None:
    from linear_model import build, look

    row = Row(s=0.43, point=(0.43, 0.0, 0.0), normal=(0.6, 0.0, 0.8))
    held = Problem(cable=cable(), grasps=grasps((0.0, (0.0, 0.0, 0.0), ALONG_X)), contacts=rubs_on([row], *next(iter(LAWS.items()))))
    system = build(held, GRAVITY)
    state = system.start(np.tile(ALONG_X, (len(system.mesh.lengths), 1)))
    drag = np.array([[0.3, -0.7]])
    gradients = []
    for one in (np.zeros((1, 2)), drag):
        moved, view = look(system, state._replace(drag=one))
        gradients.append(numpy_path.linear_system(system.rod, moved, view)[1])
    carried, _, diagonal, _, _ = numpy_path.linear_system(system.rod, moved, view)
    border = numpy_path.border_rows(system.rod, moved, view, (0.0, 0.0), np.inf)
    columns = numpy_path.border_columns(system.rod, view, border, carried, diagonal)[:, :, -2:]
    np.testing.assert_allclose(gradients[1] - gradients[0], -columns @ drag[0], atol=1e-14)


def test_meshes_find_the_same_point_of_the_cable() -> None:
    """The material point that is held is one of arc length, not of a mesh."""
    problem = dragged(Friction.SIGNUM, LAWS[Friction.SIGNUM])
    assert problem.contacts is not None
    chosen = effect.laws(problem.contacts)
    for segments in (16, 37):
        mesh = even(np.array([0.0, 1.0]), np.array([1.0]), segments)
        rub, _ = effect.rows(problem.contacts, chosen, mesh)
        own = rub.rows["element"]
        np.testing.assert_allclose(mesh.s[own] + rub.rows["fraction"] * mesh.lengths[own], np.linspace(0, 1, 17), atol=1e-14)
