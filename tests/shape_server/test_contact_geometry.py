"""Gap of every kind of contact: its slope is the column of the step, its second derivative what the border rows add."""

from __future__ import annotations

import numpy as np
import pytest
from linear_model import build, lagrangian, look, model, slopes, state_of
from rods import ALONG_X, RADIUS, Row, cable, contacts, span
from scipy.spatial.transform import Rotation

from protocol.kinds import Feature
from protocol.messages import Problem
from shape_server.rod import State
from shape_server.system import System

SEGMENTS = 12
CASES = ["face", "edge crossing", "edge askew", "vertex", "edge at a node", "edge beyond the end", "vertex beyond the end"]


def arch(turn: float = 1.0) -> np.ndarray:
    """Frames (12, 4) of a curve that leans a little aside: it sags for `turn` 1 and arches over the feature for -1."""
    rng = np.random.default_rng(2)
    # In the frames of `ALONG_X`, d1 points up and d2 along -y.
    first = Rotation.from_quat(ALONG_X) * Rotation.from_rotvec([0.0, -0.6 * turn, 0.0])
    noise = rng.normal(scale=0.02, size=(SEGMENTS, 3))
    steps = Rotation.from_rotvec(noise + np.array([0.0, turn * 1.2 / SEGMENTS, 0.0]))
    frames = [first]
    for step in steps[1:]:
        frames.append(frames[-1] * step)
    return Rotation.concatenate(frames).as_quat()


def touching(case: str, turn: float) -> tuple[System, State]:
    """A curve over one feature that pushes it up with 2 N, at a gap of 1.5 mm."""
    probe = build(Problem(cable=cable(), grasps=span()), (0.0, 0.0, 0.0), SEGMENTS)
    frames = arch(turn)
    _, view = look(probe, state_of(probe, frames))
    j, share, feature, direction = 5, 0.37, Feature.EDGE, np.array([0.1, 1.0, 0.05])
    if case == "face":
        feature = Feature.FACE
    if case.startswith("vertex"):
        feature = Feature.VERTEX
    if case == "edge askew":
        direction = np.array([0.8, 0.7, -0.2])
    if case == "edge at a node":
        share = 0.0
    if case.endswith("the end"):
        j, share = 11, 1.0
    direction /= np.linalg.norm(direction)
    tangent = view.axes[j, 2]
    across = np.cross(tangent, direction) if feature is Feature.EDGE else view.axes[j, 0]
    normal = across / np.linalg.norm(across)
    normal *= np.sign(normal[2])
    at = view.nodes[j] + share * (view.nodes[j + 1] - view.nodes[j]) - (RADIUS + 1.5e-3) * normal
    if case.endswith("the end"):
        at = at + 2e-3 * tangent
    rows = contacts(
        Row(
            s=probe.mesh.s[j] + share * probe.mesh.lengths[j],
            point=at,
            normal=normal,
            direction=direction if feature is Feature.EDGE else (0.0, 0.0, 0.0),
            feature=feature,
        )
    )
    rod = build(Problem(cable=cable(), grasps=span(), contacts=rows), (0.0, 0.0, 0.0), SEGMENTS)
    state = state_of(rod, frames)
    _, view = look(rod, state)
    push = np.zeros(len(rod.rod.touch))
    push[int(np.argmin(view.gap))] = 2.0
    return rod, state._replace(push=push, touches=push > 0.0, force=np.array([0.1, 0.2, -0.3]))


@pytest.mark.parametrize("turn", [1.0, -1.0], ids=["sagging", "arching"])
@pytest.mark.parametrize("case", CASES)
def test_the_force_of_a_contact_is_the_slope_of_its_gap(case: str, turn: float) -> None:
    rod, state = touching(case, turn)
    expected = slopes(rod, state)
    np.testing.assert_allclose(model(rod, state).gradient, expected, atol=1e-8)  # measured 1e-11, of 0.2 N m


@pytest.mark.sampled(3)
@pytest.mark.parametrize("turn", [1.0, -1.0], ids=["sagging", "arching"])
@pytest.mark.parametrize("case", CASES)
def test_the_column_of_a_contact_is_the_slope_of_its_gap(case: str, turn: float) -> None:
    rod, state = touching(case, turn)
    column = model(rod, state).columns[:, 3]
    loaded = slopes(rod, state)
    unloaded = slopes(rod, state._replace(push=np.zeros_like(state.push)))
    np.testing.assert_allclose(column, (unloaded - loaded) / 2.0, atol=1e-8)  # measured 7e-12 m


@pytest.mark.parametrize("turn", [1.0, -1.0], ids=["sagging", "arching"])
@pytest.mark.parametrize("case", CASES)
def test_the_second_derivative_holds_with_the_sliding(case: str, turn: float) -> None:
    """The quadratic model exactly as the step builds it: Hessian plus curvature rows closed over their compliance.

    The model leaves out the slope of the bulge times the second derivative of the sliding, which is what the tolerance holds.
    """
    rod, state = touching(case, turn)
    found = model(rod, state)
    matrix = found.hessian + found.curvature
    rng = np.random.default_rng(4)
    middle = lagrangian(rod, state, np.zeros((SEGMENTS, 3)))
    for _ in range(20):
        # Small turns, so that the contact stays in its segment where it slides, and at its end where it cannot.
        along = rng.normal(size=(SEGMENTS, 3)) / np.sqrt(3 * SEGMENTS)
        step = 1e-4
        second = lagrangian(rod, state, step * along) + lagrangian(rod, state, -step * along) - 2 * middle
        assert along.ravel() @ matrix @ along.ravel() == pytest.approx(
            second / step**2, rel=2e-2, abs=5e-4
        )  # measured 1.3e-2, at turns of 0.1 rad a node


@pytest.mark.parametrize(("case", "least"), [("edge askew", 0.3), ("vertex", 5.0)])
def test_the_curvature_of_a_sharp_feature_matters(case: str, least: float) -> None:
    """Without its rows the model of 2 N on a lip of 6 mm is wrong by as much as the stiffness of the cable."""
    rod, state = touching(case, 1.0)
    found = model(rod, state)
    size = np.abs(np.linalg.eigvalsh(found.curvature)).max() / np.abs(np.linalg.eigvalsh(found.hessian)).max()
    assert size > least  # measured 0.8 and 24


def test_the_gap_is_negative_on_the_wrong_side() -> None:
    rows = contacts(Row(s=0.325, point=(0.325, 0.0, 0.002), direction=(0.0, 1.0, 0.0), feature=Feature.EDGE))
    rod = build(Problem(cable=cable(), grasps=span(), contacts=rows), (0.0, 0.0, 0.0), 20)
    frames = np.tile(ALONG_X, (20, 1))
    _, view = look(rod, state_of(rod, frames))
    assert view.gap.min() == pytest.approx(-0.002 - RADIUS, abs=1e-12)


@pytest.mark.parametrize("turn", [1.0, -1.0], ids=["sagging", "arching"])
def test_gap_and_force_change_without_a_jump_as_an_edge_passes_under_every_node(turn: float) -> None:
    """The edge moves in steps of a fiftieth of a segment; on a polygon the force would jump by the turn at each node, 0.1."""
    probe = build(Problem(cable=cable(), grasps=span()), (0.0, 0.0, 0.0), SEGMENTS)
    frames = arch(turn)
    _, view = look(probe, state_of(probe, frames))
    nodes, gaps, forces = view.nodes, [], []
    along = np.linspace(probe.mesh.s[3], probe.mesh.s[8], 5 * 50)
    axis = np.column_stack([np.interp(along, probe.mesh.s, nodes[:, k]) for k in range(3)])
    for s, at in zip(along, axis, strict=True):
        rows = contacts(Row(s=s, point=at - [0.0, 0.0, 0.008], direction=(0.0, 1.0, 0.0), feature=Feature.EDGE))
        rod = build(Problem(cable=cable(), grasps=span(), contacts=rows), (0.0, 0.0, 0.0), SEGMENTS)
        _, view = look(rod, state_of(rod, frames))
        gaps.append(view.gap.min())
        forces.append(view.push[int(np.argmin(view.gap))])
    assert np.abs(np.diff(gaps)).max() < 2e-4  # measured 1e-4 m
    assert np.linalg.norm(np.diff(forces, axis=0), axis=1).max() < 0.02  # measured 0.0024


@pytest.mark.parametrize("past", [-1e-3, -1e-7, 1e-7, 1e-3, 0.02])
def test_past_its_end_an_edge_is_the_point_where_it_ends(past: float) -> None:
    """Straight along x, 6 mm over an edge across that ends `past` short of the cable: the gap grows by the distance to its end alone."""
    at, height = np.array([0.3, 0.0, -RADIUS - 6e-3]), RADIUS + 6e-3
    row = Row(s=0.3, point=at, normal=(0.0, 0.0, 1.0), direction=(0.0, 1.0, 0.0), feature=Feature.EDGE, extent=(-1.0, -past))
    rod = build(Problem(cable=cable(), grasps=span(1 - 1e-9), contacts=contacts(row)), (0.0, 0.0, 0.0), SEGMENTS)
    _, view = look(rod, state_of(rod, np.tile(ALONG_X, (SEGMENTS, 1))))
    assert view.gap.min() == pytest.approx(np.hypot(height, max(past, 0.0)) - RADIUS, abs=1e-12)
