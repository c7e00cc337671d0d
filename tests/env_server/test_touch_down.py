"""The touch-down experiment: `scenarios/touch_down.toml` against a boundary-value problem, and limp, against the catenary.

With the origin where the cable leaves the ground, l metres of it free, (H, V + w s) the force of what follows and M = EI theta':

    x' = cos theta,   z' = sin theta,   EI theta'' = H sin theta - (V + w s) cos theta

theta = theta' = z = 0 at s = 0; x = X - (L - l), z = h, theta' = 0 at the hinge s = l. H, V and l are found with the shape (scipy,
`solve_bvp`). Without bending the free part is a catenary tangent to the ground: l^2 = h^2 + 2 h c, span c asinh(l / c).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from in_process import steps
from scipy.integrate import solve_bvp
from scipy.optimize import brentq

import scenarios
from env_server.hanging import Hanging
from env_server.stepped import Stepped
from protocol.kinds import Outcome
from protocol.scene import Move, Scene, Target

SCENE = scenarios.load("touch_down")
LENGTH, WEIGHT = 1.2, 0.09 * 9.81  # m, N/m


def limp() -> tuple[float, float, float]:
    """Free length, horizontal force and height of the catenary for the start of the scene."""
    rise, across = 0.40 - 0.0045, 1.1

    def miss(c: float) -> float:
        free = np.sqrt(rise**2 + 2 * rise * c)
        return float(LENGTH - free + c * np.arcsinh(free / c) - across)

    c = brentq(miss, 1e-6, 10.0)
    return float(np.sqrt(rise**2 + 2 * rise * c)), WEIGHT * c, rise


def lifted(bending: float, across: float, rise: float) -> tuple[float, float, np.ndarray]:
    """Free length [m], vertical force [N] where it leaves the ground, and places (101, 2) [m] of the free part, by scipy."""
    free, pull, _ = limp()

    def slopes(u: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        turn = (p[0] * np.sin(y[2]) - (p[1] + WEIGHT * p[2] * u) * np.cos(y[2])) / bending
        return p[2] * np.vstack([np.cos(y[2]), np.sin(y[2]), y[3], turn])

    def ends(a: np.ndarray, b: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.array([a[0] - (LENGTH - p[2]), a[1], a[2], a[3], b[0] - across, b[1] - rise, b[3]])

    u = np.linspace(0.0, 1.0, 200)
    slope = np.arctan(WEIGHT * free * u / pull)
    guess = np.vstack([LENGTH - free + (across - LENGTH + free) * u, rise * u**2, slope, np.gradient(slope, free * u)])
    found = solve_bvp(slopes, ends, u, guess, p=[pull, -0.1, free], tol=1e-8, max_nodes=50_000)
    assert found.status == 0, found.message
    return float(found.p[2]), float(found.p[1]), np.asarray(found.sol(np.linspace(0.0, 1.0, 101))[:2].T)


def first_step(scene: Scene) -> Stepped:
    _, step = next(iter(steps(scene)))
    assert step.cables[0].shape.outcome is Outcome.CONVERGED, step.cables[0].shape.sentence
    return step


def carried(cable: Hanging) -> float:
    """What the ground carries [N], with the half segment beside the clamp, whose weight acts at the clamped node."""
    return float(cable.boundary.pushes.force[:, 2].sum() + 0.5 * WEIGHT * cable.shape.s[1])


def test_the_free_part_is_that_of_the_boundary_value_problem() -> None:
    cable = first_step(SCENE).cables[0]
    free, vertical, places = lifted(0.005, 1.1, 0.40 - 0.0045)
    s = LENGTH - free + free * np.linspace(0.0, 1.0, 101)
    ours = np.column_stack([np.interp(s, cable.shape.s, cable.shape.nodes[:, k]) for k in (0, 2)]) - [0.0, 0.0045]
    assert np.linalg.norm(ours - places, axis=1).max() < SCENE.tolerance
    spacing = float(np.diff(cable.shape.s).max())
    assert abs(cable.boundary.pushes.s.max() - (LENGTH - free)) < spacing  # it leaves between two nodes
    # The ground carries what lies, and the force where the cable leaves it.
    assert carried(cable) == pytest.approx(WEIGHT * (LENGTH - free) - vertical, rel=1e-3)  # measured 9.3e-5


def test_a_limp_cable_leaves_the_ground_as_a_catenary() -> None:
    """EI a thousandth: the length that lies is that of the catenary to within a boundary layer, sqrt(EI / H)."""
    soft = replace(SCENE.cables[0], bending=5e-6, twist=5e-6)
    cable = first_step(replace(SCENE, cables=(soft,), tolerance=1e-3)).cables[0]
    free, pull, _ = limp()
    spacing = float(np.diff(cable.shape.s).max())
    assert abs(cable.boundary.pushes.s.max() - (LENGTH - free)) < spacing + 2 * np.sqrt(5e-6 / pull)


def test_the_ground_carries_the_same_at_twice_the_nodes() -> None:
    """Forces where the cable leaves the ground, and in all: the tolerance decides the nodes."""
    forces, nodes = [], []
    for tolerance in (2e-4, 2e-5):
        cable = first_step(replace(SCENE, tolerance=tolerance)).cables[0]
        forces.append(carried(cable))
        nodes.append(len(cable.shape.s))
    assert nodes[1] >= 2 * nodes[0] - 1
    assert forces[0] == pytest.approx(forces[1], rel=5e-3)  # measured 1.1e-4


def test_more_and_more_lies_as_the_hand_goes_down_and_forces_balance_at_every_step() -> None:
    lying = []
    for _, step in steps(SCENE):
        cable = step.cables[0]
        assert cable.shape.outcome is Outcome.CONVERGED, cable.shape.sentence
        assert cable.bodies.penetration < 2e-6
        total = cable.boundary.pushes.force.sum(axis=0) + cable.shape.grasp_wrenches[:, :3].sum(axis=0)
        assert np.abs(total - [0.0, 0.0, WEIGHT * LENGTH]).max() < 1e-9 * WEIGHT * LENGTH
        is_in_plane = np.abs(cable.shape.nodes[:, 1]).max() < 1e-6
        assert is_in_plane or len(lying) > 40  # then it gives way sideways, as the scene says
        lying.append(float(cable.boundary.pushes.s.max()))
    assert lying[-1] > lying[0] + 0.2
    assert (np.diff(lying) > -0.026).all()  # by whole nodes, and these come and go


def test_a_closed_path_creates_no_energy() -> None:
    """The hand goes 0.1 m down and up again, over ground without friction: the work of its path is zero, the shape is the same."""
    moves = tuple(
        Move(name=name, duration=0.5, targets=(Target(gripper="hand", by=(0.0, 0.0, z)),)) for name, z in (("d", -0.1), ("u", 0.1))
    )
    places, forces, energies, first, last = [], [], [], None, None
    for _, step in steps(replace(SCENE, moves=moves, pictures=(), tolerance=1e-3)):
        cable = step.cables[0]
        assert cable.shape.outcome is Outcome.CONVERGED, cable.shape.sentence
        first, last = first or cable.shape, cable.shape
        places.append(step.posture.positions[1])
        forces.append(cable.shape.grasp_wrenches[1, :3])
        energies.append(cable.shape.energy)
    work = 0.5 * np.einsum("ij,ij->i", np.array(forces[1:]) + np.array(forces[:-1]), np.diff(places, axis=0))
    down, up = work[: len(work) // 2].sum(), work[len(work) // 2 :].sum()
    assert first is not None
    assert last is not None
    assert len(last.s) == len(first.s)
    assert np.linalg.norm(last.nodes - first.nodes, axis=1).max() < 1e-6
    assert down + up > -1e-6 * abs(down)
    assert down == pytest.approx(energies[len(energies) // 2] - energies[0], rel=0.02)  # the trapezium rule in ten steps


def test_without_bending_it_leaves_the_ground_as_the_catenary_at_every_step() -> None:
    """The last place that is carried, the pull and the balance, by the closed form of a cable that lies on smooth ground."""
    chain = replace(SCENE.cables[0], bending=None, twist=None)
    _, wanted, _ = limp()
    pulls = []
    for _, step in steps(replace(SCENE, cables=(chain,), tolerance=1e-3)):
        cable = step.cables[0]
        assert cable.shape.outcome is Outcome.CONVERGED, cable.shape.sentence
        assert cable.bodies.penetration < 1e-6
        total = cable.boundary.pushes.force.sum(axis=0) + cable.shape.grasp_wrenches[:, :3].sum(axis=0)
        assert np.abs(total - [0.0, 0.0, WEIGHT * LENGTH]).max() < 1e-9 * WEIGHT * LENGTH
        place, pull = step.posture.positions[1], cable.shape.grasp_wrenches[1, :3]
        # H, V and w: the free part is V / w long, and reaches H / w (sqrt(1 + (V / H)^2) - 1) up.
        rise = (np.hypot(pull[0], pull[2]) - pull[0]) / WEIGHT
        assert rise == pytest.approx(place[2] - 0.0045, abs=2e-3)
        across = LENGTH - pull[2] / WEIGHT + pull[0] / WEIGHT * np.arcsinh(pull[2] / pull[0])
        assert across == pytest.approx(place[0], abs=2e-3)
        pulls.append(pull[0])
    assert pulls[0] == pytest.approx(wanted, rel=1e-3)  # measured 3e-5
    assert pulls[-1] < 0.4 * pulls[0]
