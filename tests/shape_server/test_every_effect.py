"""The contract that every effect keeps, found by its name in the table; a new effect is tested without a change here.

One posture asks for each effect; a new name in `ASKED_BY` fails here until it has one.
"""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from linear_model import Model, bend, build, look, model, slopes, state_of
from rods import ALONG_X, GRAVITY, WEIGHTLESS, Row, cable, contacts, grasps, span
from scipy.spatial.transform import Rotation

import shape_server
from protocol.kinds import Feature, Friction
from protocol.messages import FrictionLaw, PointLoads, Problem, Rubbing, SelfContacts, Start
from protocol.scene import LumpedMass, Vector
from shape_server import effects, numpy_path, solve
from shape_server.newton import _last_segments
from shape_server.rod import State
from shape_server.system import System


def replace_part(part: object, **changes: object) -> object:
    """A message part with some fields changed."""
    return type(part)(**{name: changes.get(name, getattr(part, name)) for name in part.__struct_fields__})


FOLDER = Path(shape_server.__file__).parent / "effects"
ROD = Problem(cable=cable(mass=0.0), grasps=span())
FEATURE = Row(s=0.47, point=(0.28, 0.0, -0.2), direction=(0.0, 1.0, 0.0), feature=Feature.EDGE)
LOADS = PointLoads(s=np.array([0.25, 0.47]), force=np.array([[0.1, -0.2, -0.3], [0.0, 0.1, 0.2]]))
RUBBING = Rubbing(
    contact=np.array([0]),
    law=np.array([0]),
    s=np.array([FEATURE.s]),
    anchor=np.array([[0.28, 0.01, -0.195]]),
    laws=(FrictionLaw(coefficient=0.3),),
    time_step=0.1,
)


def arch() -> Start:
    """A cable that bends evenly by 2.6 rad, about as far as its grasps ask for."""
    turns = np.linspace(-1.3, 1.3, 12)
    frames = (Rotation.from_rotvec(np.outer(turns, [0.0, 1.0, 0.0])) * Rotation.from_quat(ALONG_X)).as_quat()
    return Start(s=np.linspace(0.0, 1.0, 13), frames=frames, grasp_forces=np.zeros((2, 3)))


def near_itself(distance: float) -> SelfContacts:
    """Two places of the cable that may touch."""
    return SelfContacts(
        s=np.array([[0.14, 0.77], [0.17, 0.8]]),
        kind=np.zeros(2, dtype=np.int64),
        normal=np.array([[-1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]),
        distance=np.full(2, distance),
        force=np.zeros((2, 3)),
    )


POSTURES: dict[str, tuple[Problem, Vector]] = {
    "gravity": (Problem(cable=cable(), grasps=span()), GRAVITY),
    "masses": (Problem(cable=replace(cable(mass=0.0), masses=(LumpedMass(0.47, 0.1),)), grasps=span()), GRAVITY),
    "loads": (Problem(cable=cable(mass=0.0), grasps=span(), loads=LOADS), WEIGHTLESS),
    "bending": (replace_part(ROD, cable=replace(cable(mass=0.0), bending_2=3e-2)), WEIGHTLESS),
    "twist": (ROD, WEIGHTLESS),
    "preform": (replace_part(ROD, cable=replace(cable(mass=0.0), natural_curvature=(0.5, -2.0, 1.0))), WEIGHTLESS),
    "micro_length": (replace_part(ROD, cable=replace(cable(mass=0.0), micro_length=0.1)), WEIGHTLESS),
    "bend_radius": (replace_part(ROD, cable=replace(cable(mass=0.0), bend_radius=0.1)), WEIGHTLESS),
    "stretch": (replace_part(ROD, cable=replace(cable(mass=0.0), stretch=20.0)), WEIGHTLESS),
    "contact": (Problem(cable=cable(mass=0.0), grasps=span(), contacts=contacts(FEATURE)), WEIGHTLESS),
    "friction": (
        Problem(cable=cable(mass=0.0), grasps=span(), contacts=replace_part(contacts(FEATURE), friction=np.array([3]), rubbing=RUBBING)),
        WEIGHTLESS,
    ),
    "bond": (Problem(cable=cable(mass=0.0), grasps=span(), contacts=contacts(replace(FEATURE, friction=Friction.BOND))), WEIGHTLESS),
    "inclination": (
        Problem(
            cable=cable(mass=0.0),
            grasps=span(),
            contacts=replace_part(contacts(replace(FEATURE, friction=Friction.BOND)), inclination=np.array([1])),
        ),
        WEIGHTLESS,
    ),
    "self_contact": (Problem(cable=cable(mass=0.0), grasps=span(), start=arch(), self_contacts=near_itself(0.009)), WEIGHTLESS),
}
"""A posture for every effect: the smallest problem that asks for it."""
INTERNAL = ("bending", "twist", "preform", "micro_length", "bend_radius", "stretch", "self_contact")  # forces of the cable on itself

EVERY = pytest.mark.parametrize("name", list(effects.ASKED_BY))


def crooked(count: int) -> np.ndarray:
    """Frames (count, 4) along a curve in space, twisted."""
    rng = np.random.default_rng(8)
    noise = rng.normal(scale=0.15, size=(count, 3))
    steps = Rotation.from_rotvec(noise + np.array([0.0, 0.9 / count, 0.3 / count]))
    frames = [Rotation.from_quat(ALONG_X) * Rotation.from_rotvec([0.1, -0.4, 0.2])]
    for step in steps[1:]:
        frames.append(frames[-1] * step)
    return Rotation.concatenate(frames).as_quat()


def curled(count: int) -> np.ndarray:
    """Frames (count, 4) along an uneven loop of one turn and a half."""
    noise = np.random.default_rng(3).normal(scale=0.05, size=(count, 3))
    frames = [Rotation.from_quat(ALONG_X) * Rotation.from_rotvec([0.1, -0.4, 0.2])]
    for step in Rotation.from_rotvec(noise[1:] + np.array([0.0, 3.0 * np.pi / count, 0.02])):
        frames.append(frames[-1] * step)
    return Rotation.concatenate(frames).as_quat()


def loaded(name: str) -> tuple[System, State]:
    """A crooked rod under one effect, every row of it with a force."""
    problem, gravity = POSTURES[name]
    rod = build(problem, gravity)
    frames = crooked(len(rod.mesh.lengths))
    if name == "bend_radius":  # so little that the crooked rod is beyond it
        rod = build(replace_part(problem, cable=replace(problem.cable, bend_radius=0.4)), gravity)
    elif name == "self_contact":
        frames = curled(len(frames))
        gap = look(rod, state_of(rod, frames))[1].gap.min()
        rod = build(replace_part(problem, self_contacts=near_itself(0.009 + gap - 1e-3)), gravity)
    elif len(rod.push):
        rod = build(Problem(cable=problem.cable, grasps=problem.grasps, contacts=contacts(under(rod, frames))), gravity)
    state = state_of(rod, frames)
    force = np.random.default_rng(9).normal(size=state.force.shape)
    push = state.push
    if len(rod.push):
        gap = look(rod, state)[1].gap
        assert np.abs(gap).min() < 2e-3
        push = np.where(np.arange(len(gap)) == np.argmin(np.abs(gap)), 1.5, 0.0)
    return rod, state_of(rod, frames, force=force, push=push)


def under(rod: System, frames: np.ndarray) -> Row:
    """`FEATURE` moved to just below the crooked cable."""
    _, view = look(rod, state_of(rod, frames))
    j = 5
    normal = np.cross(view.axes[j, 2], FEATURE.direction)
    normal *= np.sign(normal[2]) / np.linalg.norm(normal)
    at = view.nodes[j] + 0.4 * (view.nodes[j + 1] - view.nodes[j])
    return replace(FEATURE, s=rod.mesh.s[j] + 0.4 * rod.mesh.lengths[j], point=at - (FEATURE.distance + 1e-3) * normal, normal=normal)


def moved(problem: Problem, gravity: Vector, turn: Rotation, shift: np.ndarray) -> tuple[Problem, Vector]:
    """The whole problem turned and then displaced."""
    held = problem.grasps
    held = replace_part(held, position=turn.apply(held.position) + shift, quaternion=(turn * Rotation.from_quat(held.quaternion)).as_quat())
    touched = problem.contacts
    if touched is not None:
        touched = replace_part(
            touched,
            point=turn.apply(touched.point) + shift,
            normal=turn.apply(touched.normal),
            direction=turn.apply(touched.direction),
            rubbing=touched.rubbing and replace_part(touched.rubbing, anchor=turn.apply(touched.rubbing.anchor) + shift),
        )
    g = turn.apply(gravity)
    loads, start, own = problem.loads, problem.start, problem.self_contacts
    if loads is not None:
        loads = replace_part(loads, force=turn.apply(loads.force))
    if start is not None:
        start = replace_part(start, frames=(turn * Rotation.from_quat(start.frames)).as_quat())
    if own is not None:
        own = replace_part(own, normal=turn.apply(own.normal))
    there = Problem(cable=problem.cable, grasps=held, contacts=touched, loads=loads, start=start, self_contacts=own)
    return there, (float(g[0]), float(g[1]), float(g[2]))


def quadratic_form(found: Model, turn: np.ndarray) -> float:
    """Second derivative that the step believes in."""
    return float(turn.ravel() @ (found.hessian + found.curvature) @ turn.ravel())


def test_every_effect_has_a_posture_here() -> None:
    assert POSTURES.keys() == effects.ASKED_BY.keys()


def test_every_effect_has_a_file_and_every_file_is_in_the_table() -> None:
    assert {path.stem for path in FOLDER.glob("*.py")} - {"__init__"} == effects.ASKED_BY.keys()


@EVERY
def test_the_posture_asks_for_the_effect(name: str) -> None:
    problem, gravity = POSTURES[name]
    assert name in effects.asked_for(problem, gravity)


@EVERY
def test_an_effect_says_in_its_file_what_it_is(name: str) -> None:
    text = effects.load(name).__doc__ or ""
    assert len(text.split()) > 20


@EVERY
def test_the_gradient_is_the_slope_of_the_energy(name: str) -> None:
    rod, state = loaded(name)
    np.testing.assert_allclose(model(rod, state).gradient, slopes(rod, state), atol=1e-8)  # measured 1e-11


@EVERY
def test_the_hessian_is_the_second_derivative_of_the_energy(name: str) -> None:
    rod, state = loaded(name)
    found = model(rod, state)
    rng = np.random.default_rng(10)
    for _ in range(10):
        turn = rng.normal(size=state.frames[:, :3].shape)
        assert quadratic_form(found, turn) == pytest.approx(
            bend(rod, state, turn, 1e-4), rel=5e-4, abs=1e-4
        )  # measured 2e-8, contact 1.1e-4


@EVERY
def test_the_rows_change_with_turns_and_forces_as_their_columns_and_compliance_say(name: str) -> None:
    rod, state = loaded(name)
    found = model(rod, state)
    rng = np.random.default_rng(11)
    turn, force = rng.normal(size=state.frames[:, :3].shape), rng.normal(size=state.force.shape)

    def missed(size: float) -> np.ndarray:
        moved = state._replace(frames=numpy_path.retract(state.frames, size * turn), force=state.force + size * force)
        return look(rod, moved)[1].miss

    change = (missed(1e-6) - missed(-1e-6)) / 2e-6
    held = len(state.force)
    expected = found.columns[:, :held].T @ turn.ravel() + found.compliance[:held, :held] @ force
    np.testing.assert_allclose(change, expected, atol=1e-8)  # measured 5e-10


@EVERY
@pytest.mark.parametrize("base", [0, 12])
def test_columns_begin_where_they_are_said_to(name: str, base: int) -> None:
    rod, state = loaded(name)
    held = rod.rod._replace(base=base)
    moved, view = numpy_path.look(held, state, np.ascontiguousarray(held.touch["normal"]))
    carried, _, diagonal, _, _ = numpy_path.linear_system(held, moved, view)
    border = numpy_path.border_rows(held, moved, view, (0.0, 0.0), np.inf)
    columns = numpy_path.border_columns(held, view, border, carried, diagonal)
    last = _last_segments.py_func(border.element, border.vector, border.is_turn, base, len(columns))
    for row in range(len(last)):
        assert not columns[last[row] + 1 :, :, row].any()
        if border.is_turn[row]:
            assert not columns[: last[row], :, row].any()


@EVERY
def test_the_hessian_is_symmetric(name: str) -> None:
    rod, state = loaded(name)
    found = model(rod, state)
    for matrix in (found.hessian, found.curvature):
        np.testing.assert_allclose(matrix, matrix.T, atol=1e-12 * max(1.0, np.abs(matrix).max()))


@EVERY
def test_internal_effects_exert_no_net_force_and_no_net_moment(name: str) -> None:
    """Turning the whole free cable changes no energy of its own; gravity changes it by the moment of the weight."""
    problem, gravity = POSTURES[name]
    rod = build(problem, gravity)
    rod = replace(rod, rod=rod.rod._replace(clamp_of_node=np.full(len(rod.mesh.s), -1), clamp_frames=np.zeros((0, 4))))
    frames = crooked(len(rod.mesh.lengths))
    state = state_of(rod, frames)
    state = state._replace(force=np.zeros_like(state.force), push=np.zeros_like(state.push), touches=np.zeros_like(state.touches))
    gradient = model(rod, state).gradient.reshape(-1, 3)
    moment = Rotation.from_quat(frames).apply(gradient).sum(axis=0)
    _, view = look(rod, state)
    expected = -np.cross(view.nodes - rod.rod.origin, rod.rod.loads).sum(axis=0)
    np.testing.assert_allclose(moment, expected, atol=1e-14)
    cable = problem.cable
    weight = np.multiply(cable.mass_per_length * cable.length + sum(mass.mass for mass in cable.masses), gravity)
    if problem.loads is not None:
        weight += problem.loads.force.sum(axis=0)
    np.testing.assert_allclose(rod.rod.loads.sum(axis=0), weight, atol=1e-15)
    if name in INTERNAL:
        assert not rod.rod.loads.any()


@EVERY
def test_a_straight_cable_at_rest_feels_nothing_but_its_weight(name: str) -> None:
    problem, gravity = POSTURES[name]
    straight = grasps((0.0, (0.0, 0.0, 0.0), ALONG_X), (1.0, (1.0, 0.0, 0.0), ALONG_X))
    rest = replace(problem.cable, natural_curvature=None)
    rod = build(Problem(cable=rest, grasps=straight, contacts=problem.contacts, loads=problem.loads), gravity)
    state = state_of(rod, np.tile(ALONG_X, (len(rod.mesh.lengths), 1)))
    gradient = model(rod, state).gradient.reshape(-1, 3)
    carried = numpy_path.carried_forces(rod.rod.loads, rod.rod.base)
    turned = np.cross([0.0, 0.0, 1.0], Rotation.from_quat(ALONG_X).inv().apply(carried)) * rod.mesh.lengths[:, None]
    np.testing.assert_allclose(gradient, -turned, atol=1e-14)
    if name not in ("gravity", "masses", "loads"):
        assert not gradient.any()


@pytest.mark.sampled(6)
@EVERY
def test_the_shape_turns_and_moves_with_the_problem(name: str) -> None:
    problem, gravity = POSTURES[name]
    turn, shift = Rotation.from_rotvec([0.3, -1.1, 0.7]), np.array([0.4, -2.0, 1.3])
    here = solve(problem, gravity)
    there = solve(*moved(problem, gravity, turn, shift))
    assert here.outcome is there.outcome
    assert len(here.s)
    # Weightless between equal clamps, a cable may lean to any side; its size may not depend on where it stands.
    assert there.tension.max() == pytest.approx(here.tension.max(), abs=1e-4)
    if name == "gravity":
        np.testing.assert_allclose(there.nodes, turn.apply(here.nodes) + shift, atol=1e-6)


@EVERY
def test_the_gradient_turns_and_moves_with_the_problem(name: str) -> None:
    rod, state = loaded(name)
    turn = Rotation.from_rotvec([0.3, -1.1, 0.7])
    problem, gravity = POSTURES[name]
    if name == "bend_radius":
        problem = replace_part(problem, cable=replace(problem.cable, bend_radius=0.4))
    elif name == "self_contact":
        problem = replace_part(problem, self_contacts=near_itself(float(rod.rod.strands.distance[0])))
    elif len(rod.push):
        problem = Problem(cable=problem.cable, grasps=problem.grasps, contacts=contacts(under(rod, state.frames)))
    rod_there = build(*moved(problem, gravity, turn, np.array([0.4, -2.0, 1.3])))
    frames = (turn * Rotation.from_quat(state.frames)).as_quat()
    there = state._replace(frames=frames)
    points = len(state.force) - rod.rod.held.inclined
    turned = turn.apply(state.force[:points].reshape(-1, 3))
    there = there._replace(force=np.append(turned.ravel(), state.force[points:]))
    if name == "self_contact":
        there = there._replace(fraction=rod_there.fraction)
    expected = model(rod, state).gradient
    np.testing.assert_allclose(model(rod_there, there).gradient, expected, atol=1e-12)


@pytest.mark.sampled(6)
@EVERY
def test_an_effect_that_is_not_asked_for_is_not_imported_and_adds_nothing(name: str) -> None:
    """In a program of its own: the effects imported are exactly those that the request asks for."""
    script = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from test_every_effect import POSTURES
for key in [key for key in sys.modules if key.startswith("shape_server")]:
    del sys.modules[key]
import shape_server
from shape_server import effects
problem, gravity = POSTURES[{name!r}]
shape_server.solve(problem, gravity)
loaded = {{key.removeprefix("shape_server.effects.") for key in sys.modules if key.startswith("shape_server.effects.")}}
print(sorted(loaded), sorted(effects.asked_for(problem, gravity)), sep="|")
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=True)
    imported, asked = done.stdout.strip().split("|")
    assert imported == asked


@EVERY
def test_leaving_an_effect_out_leaves_out_its_unknowns(name: str) -> None:
    problem, gravity = POSTURES[name]
    bare = build(ROD, WEIGHTLESS).rod
    rod = build(problem, gravity).rod
    added = {
        "gravity": rod.loads.any(),
        "masses": rod.loads.any(),
        "loads": rod.loads.any(),
        "bending": rod.elastic.law[0, 0] > 0,
        "twist": rod.elastic.law[0, 2] > 0,
        "preform": rod.elastic.bent.any(),
        "micro_length": len(rod.elastic.smoothing) > 0,
        "stretch": len(rod.give) > 0,
        "bend_radius": len(rod.elastic.limit) > 0,
        "inclination": rod.held.inclined > 0,
        "self_contact": len(rod.strands.distance) > 0,
        "contact": len(rod.touch) > 0,
        "friction": len(rod.rub.rows) > 0,
        "bond": len(rod.held.rows) > len(bare.held.rows),
    }
    assert added[name]
    assert len(bare.touch) == len(bare.give) == len(bare.elastic.smoothing) == len(bare.elastic.limit) == 0
    assert len(bare.strands.distance) == bare.held.inclined == len(bare.rub.rows) == 0
    assert not bare.loads.any()
    assert not bare.elastic.bent.any()
    assert len(bare.held.rows) == 3
