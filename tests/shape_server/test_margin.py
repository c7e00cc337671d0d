"""Stability margin, other stable shapes, and the fold that is announced before it is reached."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from linear_model import build, look, model
from rods import ALONG_X, GRAVITY, KERNELS, WEIGHTLESS, cable, frame, grasps, random_spans, span, start_from
from scipy.linalg import eigh, null_space

from protocol.kinds import Outcome
from protocol.messages import Problem, Shape
from shape_server import numpy_path, solve
from shape_server.descent import relax


@pytest.mark.parametrize("path", [KERNELS, numpy_path], ids=["compiled", "numpy"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_margin_is_the_smallest_eigenvalue_on_what_the_rows_leave_free(seed: int, path: object) -> None:
    problem = random_spans(1, 1e-2, seed)[0]
    system = build(problem, GRAVITY, 24)
    frames = solve(problem, GRAVITY, path=KERNELS).frames
    found = relax(
        numpy_path, system.rod, system.start(numpy_path.interpolate_frames(*spread(frames), middles(system.mesh.s))), print_nothing
    )
    value, mode = path.smallest_stiffness(system.rod, found.state, found.seen)
    matrices = model(system, found.state)
    free = null_space(matrices.columns.T)
    mass = np.diag(np.repeat(system.mesh.lengths, 3))
    exact = eigh(free.T @ matrices.hessian @ free, free.T @ mass @ free, eigvals_only=True)
    assert value == pytest.approx(exact[0], rel=1e-3)  # measured 2e-5; an upper bound
    assert value >= exact[0] * (1 - 1e-9)
    assert (mass @ mode.ravel() @ mode.ravel()) == pytest.approx(1.0, rel=1e-9)
    assert np.abs(matrices.columns.T @ mode.ravel()).max() < 1e-8
    assert look(system, found.state)[1].nodes.shape == (25, 3)


def print_nothing(iteration: int, residual: float) -> None:
    """No progress is shown."""


def spread(frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return (np.arange(len(frames)) + 0.5) / len(frames), np.array(frames)


def middles(s: np.ndarray) -> np.ndarray:
    return 0.5 * (s[1:] + s[:-1])


def test_the_margin_is_found_only_when_asked_for() -> None:
    problem = Problem(cable=cable(), grasps=span())
    assert solve(problem, GRAVITY, path=KERNELS).margin is None
    shape = solve(problem, GRAVITY, margin=True, path=KERNELS)
    assert shape.margin is not None
    assert shape.margin > 0.0
    assert shape.cost.certify > 0.0


def squeezed(rise: float, before: Shape | None) -> Shape:
    """A clamped arch of 1 m over a chord of 0.95 m, its clamps tilted by `rise` [rad] until it snaps through."""
    first, last = frame((np.cos(rise), 0.0, np.sin(rise))), frame((np.cos(rise), 0.0, -np.sin(rise)))
    held = grasps((0.0, (0, 0, 0), first), (1.0, (0.95, 0, 0), last))
    start = None if before is None else msgspec.structs.replace(start_from(before), margin=before.margin)
    problem = Problem(cable=cable(mass=0.0, twist=1.0), grasps=held, start=start)
    return solve(problem, WEIGHTLESS, margin=True, extrapolate=False, path=KERNELS)


def test_a_fold_is_announced_before_the_arch_snaps_through() -> None:
    """The arch stands up with raised clamps; turned down step by step it must snap, and says beforehand in how many steps."""
    shape, announced, snapped = squeezed(0.5, None), [], None
    up = np.sign(shape.nodes[len(shape.s) // 2, 2])
    for step in range(1, 80):
        after = squeezed(0.5 - 0.02 * step, shape)
        assert after.outcome is Outcome.CONVERGED, after.sentence
        if np.sign(after.nodes[len(after.s) // 2, 2]) != up and not after.sentence.startswith("settled"):
            snapped = step
            break
        announced.append(after.fold)
        shape = after
    assert snapped is not None
    warned = [(step + 1, fold) for step, fold in enumerate(announced) if fold is not None and step + 1 >= snapped - 4]
    assert warned
    for step, fold in warned[-2:]:
        # Measured 23.8 and 24.3 of 26: at a symmetric bifurcation as here the margin falls linearly, and the warning is early.
        assert snapped - 2.5 < step + fold < snapped + 0.5


def test_other_stable_shapes_can_be_asked_for_by_energy() -> None:
    problem = Problem(cable=cable(bending=1e-1, mass=0.02), grasps=span(0.9))
    shapes = [solve(msgspec.structs.replace(problem, branch=k), GRAVITY, path=KERNELS) for k in (1, 2, 3)]
    assert all(shape.outcome is Outcome.CONVERGED and shape.is_stable for shape in shapes)
    energies = [shape.energy for shape in shapes]
    assert energies == sorted(energies)
    assert energies[1] - energies[0] > 0.5  # J; a turn of twist
    assert shapes[1].total_twist == pytest.approx(-shapes[2].total_twist, abs=1e-3)  # one the mirror image of the other
    assert shapes[0].energy == pytest.approx(solve(problem, GRAVITY, path=KERNELS).energy, rel=1e-6)


def test_a_branch_that_was_not_found_is_refused_with_how_many_there_are() -> None:
    shape = solve(Problem(cable=cable(), grasps=grasps((0.0, (0, 0, 0), ALONG_X)), branch=2), GRAVITY, path=KERNELS)
    assert shape.outcome is Outcome.UNSUPPORTED
    assert "branch 2 was asked for, and 1 different stable shapes were found" in shape.sentence


@pytest.mark.parametrize("turns", [0, 1, -2, 5])
def test_whole_turns_asked_for_are_there_and_reported(turns: int) -> None:
    """Taut, so that it does not loop: the twist is what was asked, less what the sag's writhe takes."""
    problem = Problem(cable=cable(mass=0.01, twist=1e-3), grasps=span(0.9999), turns=(turns,))
    shape = solve(problem, GRAVITY, path=KERNELS)
    assert shape.outcome is Outcome.CONVERGED
    assert shape.total_twist == pytest.approx(2 * np.pi * turns, abs=0.05)  # measured within 1e-6 to 0.02
    assert shape.grasp_wrenches[1, 3] == pytest.approx(1e-3 * 2 * np.pi * turns, rel=0.02, abs=1e-9)
