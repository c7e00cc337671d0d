"""Compiled kernels against their numpy twins, and both against differences and dense matrices."""

from __future__ import annotations

import inspect
from types import ModuleType

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from shape_server import kernels, numpy_path, numpy_vertices
from shape_server.system import elastic_of

NO_TIES = np.zeros((0, 2))
PATHS = pytest.mark.parametrize("path", [kernels, numpy_path], ids=["compiled", "numpy"])


class Sample:
    """A random rod of ten uneven segments with clamps at node 0, in the middle and at the end; seeded."""

    def __init__(self, *, bend: float = 1.0) -> None:
        rng = np.random.default_rng(3)
        self.lengths = rng.uniform(0.05, 0.15, 10)
        self.frames = Rotation.from_rotvec(np.cumsum(bend * rng.normal(scale=0.4, size=(10, 3)), axis=0)).as_quat()
        self.frames[3] *= -1.0  # the same rotation
        self.clamp_of_node = np.full(11, -1)
        self.clamp_of_node[[0, 4, 10]] = [0, 1, 2]
        self.clamp_frames = Rotation.random(3, random_state=rng).as_quat()
        law = np.array([0.01, 0.013, 0.007]) * rng.uniform(0.5, 2.0, (10, 1))
        self.elastic = elastic_of(law, rng.normal(size=(10, 3)), self.lengths, NO_TIES)
        self.forces = rng.normal(size=(11, 3))
        self.base = 4
        self.origin = np.array([0.1, -0.2, 0.3])
        self.turn = rng.normal(size=(10, 3))

    def potential(self, path: ModuleType, frames: np.ndarray) -> float:
        """Energy less the work of the node forces [J]."""
        axes = path.directors(frames)
        nodes = path.positions(axes[:, 2], self.lengths, self.base, self.origin)
        energy = path.elastic_energy(frames, self.lengths, self.elastic, self.clamp_of_node, self.clamp_frames)
        return float(energy - np.vdot(self.forces, nodes))

    def assembled(self, path: ModuleType, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Gradient and blocks."""
        carried = path.carried_forces(self.forces, self.base)
        axes = path.directors(frames)
        return path.assemble(frames, axes, self.lengths, self.lengths, self.elastic, self.clamp_of_node, self.clamp_frames, carried)


def dense(diagonal: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """The block-tridiagonal matrix in full."""
    count = len(diagonal)
    out = np.zeros((3 * count, 3 * count))
    for i in range(count):
        out[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = diagonal[i]
        if i + 1 < count:
            out[3 * i : 3 * i + 3, 3 * i + 3 : 3 * i + 6] = upper[i]
            out[3 * i + 3 : 3 * i + 6, 3 * i : 3 * i + 3] = upper[i].T
    return out


def random_blocks(seed: int, count: int = 12) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    diagonal = rng.normal(size=(count, 3, 3))
    upper = rng.normal(size=(count, 3, 3))
    upper[-1] = 0.0
    return diagonal + np.swapaxes(diagonal, 1, 2), upper


def test_both_paths_offer_the_same_functions() -> None:
    names = {name for name, value in vars(kernels).items() if hasattr(value, "py_func")}
    assert {name for name in names if not callable(getattr(numpy_path, name, None))} == set()
    twins = {name for name in names if getattr(numpy_path, name).__module__ in (numpy_path.__name__, numpy_vertices.__name__)}
    assert twins == {
        "directors", "positions", "carried_forces", "elastic_energy", "assemble", "smoothing_energy", "add_smoothing", "columns",
        "factor_and_solve", "eliminate", "complement", "turns", "retract", "solve_symmetric", "condense",
    }  # fmt: skip
    for name in twins:
        compiled = list(inspect.signature(getattr(kernels, name).py_func).parameters)
        assert compiled == list(inspect.signature(getattr(numpy_path, name)).parameters)


@pytest.mark.parametrize("bend", [0.0, 1e-9, 1.0, 4.0])
def test_compiled_kernels_equal_their_numpy_twins(bend: float) -> None:
    sample = Sample(bend=bend)
    axes = [path.directors(sample.frames) for path in (kernels, numpy_path)]
    np.testing.assert_allclose(*axes, atol=1e-15)
    for base in (0, 4, 10):
        nodes = [path.positions(axes[0][:, 2], sample.lengths, base, sample.origin) for path in (kernels, numpy_path)]
        np.testing.assert_allclose(*nodes, atol=1e-15)
        carried = [path.carried_forces(sample.forces, base) for path in (kernels, numpy_path)]
        np.testing.assert_allclose(*carried, atol=1e-14)
    energies = [
        path.elastic_energy(sample.frames, sample.lengths, sample.elastic, sample.clamp_of_node, sample.clamp_frames)
        for path in (kernels, numpy_path)
    ]
    np.testing.assert_allclose(*energies, rtol=1e-13)
    for compiled, plain in zip(sample.assembled(kernels, sample.frames), sample.assembled(numpy_path, sample.frames), strict=True):
        np.testing.assert_allclose(compiled, plain, atol=1e-12 * np.abs(plain).max())
    for scale in (0.0, 1e-10, 1e-3, 1.0, 5.0):
        turned = [path.retract(sample.frames, scale * sample.turn) for path in (kernels, numpy_path)]
        np.testing.assert_allclose(*turned, atol=1e-15)


@pytest.mark.parametrize("base", [0, 4, 10])
def test_compiled_columns_equal_their_numpy_twins(base: int) -> None:
    sample, rng = Sample(), np.random.default_rng(5)
    axes = kernels.directors(sample.frames)
    element, fraction = rng.integers(0, 10, 30), rng.uniform(0, 1, 30)
    vector, is_turn = rng.normal(size=(30, 3)), rng.integers(0, 2, 30)
    compiled, plain = (path.columns(axes, sample.lengths, base, element, fraction, vector, is_turn) for path in (kernels, numpy_path))
    np.testing.assert_allclose(compiled, plain, atol=1e-15)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("columns", [0, 1, 7])
def test_compiled_elimination_equals_its_numpy_twin(seed: int, columns: int) -> None:
    diagonal, upper = random_blocks(seed)
    right = np.random.default_rng(seed).normal(size=(12, 3, columns))
    compiled, plain = right.copy(), right.copy()
    assert kernels.factor_and_solve(diagonal, upper, compiled) == numpy_path.factor_and_solve(diagonal, upper, plain)
    np.testing.assert_allclose(compiled, plain, atol=1e-9)  # measured 5e-11; indefinite, elimination without pivoting


@PATHS
def test_the_gradient_is_the_slope_of_the_potential(path: ModuleType) -> None:
    sample = Sample()
    gradient, _, _ = sample.assembled(path, sample.frames)
    step = 1e-6
    for j in range(10):
        for k in range(3):
            turn = np.zeros((10, 3))
            turn[j, k] = step
            slope = sample.potential(path, path.retract(sample.frames, turn)) - sample.potential(path, path.retract(sample.frames, -turn))
            assert gradient[j, k] == pytest.approx(slope / (2 * step), rel=1e-7, abs=1e-7)  # measured 5e-10 of up to 100 N m


@PATHS
def test_the_hessian_is_the_second_derivative_of_the_potential_along_any_turn(path: ModuleType) -> None:
    sample, rng = Sample(), np.random.default_rng(7)
    _, diagonal, upper = sample.assembled(path, sample.frames)
    matrix = dense(diagonal, upper)
    middle = sample.potential(path, sample.frames)
    for _ in range(20):
        turn = rng.normal(size=(10, 3))
        values = [sample.potential(path, path.retract(sample.frames, step * turn)) for step in (1e-3, -1e-3, 2e-3, -2e-3)]
        # Fourth order: (16 (first pair) - (second pair) - 30 middle) / 12
        second = (16 * (values[0] + values[1]) - values[2] - values[3] - 30 * middle) / 12e-6
        assert turn.ravel() @ matrix @ turn.ravel() == pytest.approx(second, rel=1e-6)  # measured 2e-9


@PATHS
def test_the_hessian_is_symmetric(path: ModuleType) -> None:
    sample = Sample()
    _, diagonal, upper = sample.assembled(path, sample.frames)
    np.testing.assert_allclose(diagonal, np.swapaxes(diagonal, 1, 2), atol=1e-14 * np.abs(diagonal).max())
    assert not upper[-1].any()


@PATHS
def test_the_hessian_is_the_derivative_of_the_gradient_at_a_straight_free_rod(path: ModuleType) -> None:
    """Where the gradient is zero, its derivative needs no correction for the curved space of rotations."""
    sample = Sample()
    sample.forces[:] = 0.0
    sample.clamp_of_node[:] = -1
    sample.elastic = elastic_of(sample.elastic.law, np.zeros((10, 3)), sample.lengths, NO_TIES)
    frames = np.tile(sample.clamp_frames[0], (10, 1))
    gradient, diagonal, upper = sample.assembled(path, frames)
    assert np.abs(gradient).max() < 1e-14
    matrix, step = dense(diagonal, upper), 1e-6
    for column in range(30):
        turn = np.zeros(30)
        turn[column] = step
        after = sample.assembled(path, path.retract(frames, turn.reshape(10, 3)))[0]
        before = sample.assembled(path, path.retract(frames, -turn.reshape(10, 3)))[0]
        np.testing.assert_allclose(matrix[:, column], (after - before).ravel() / (2 * step), atol=1e-8)  # measured 3e-11


@PATHS
@pytest.mark.parametrize("base", [0, 4, 10])
def test_the_columns_are_the_slopes_of_what_they_stand_for(path: ModuleType, base: int) -> None:
    sample, rng = Sample(), np.random.default_rng(11)
    element, fraction = np.arange(10), rng.uniform(0, 1, 10)
    vector, is_turn = rng.normal(size=(10, 3)), np.array([0, 1] * 5)

    def quantities(frames: np.ndarray) -> np.ndarray:
        axes = path.directors(frames)
        nodes = path.positions(axes[:, 2], sample.lengths, base, sample.origin)
        points = nodes[element] + fraction[:, None] * np.diff(nodes, axis=0)[element]
        return np.einsum("ij,ij->i", vector, np.where(is_turn[:, None] == 1, axes[element, 2], points))

    columns = path.columns(path.directors(sample.frames), sample.lengths, base, element, fraction, vector, is_turn)
    step = 1e-6
    for j in range(10):
        for k in range(3):
            turn = np.zeros((10, 3))
            turn[j, k] = step
            slope = (quantities(path.retract(sample.frames, turn)) - quantities(path.retract(sample.frames, -turn))) / (2 * step)
            np.testing.assert_allclose(columns[j, k], slope, atol=1e-9)  # measured 2e-10


@PATHS
@pytest.mark.parametrize("seed", range(20))
def test_the_count_of_negative_pivots_is_that_of_negative_eigenvalues(path: ModuleType, seed: int) -> None:
    diagonal, upper = random_blocks(seed)
    matrix = dense(diagonal, upper)
    right = np.random.default_rng(seed).normal(size=(12, 3, 2))
    solution = right.copy()
    negative = path.factor_and_solve(diagonal, upper, solution)
    assert negative == (np.linalg.eigvalsh(matrix) < 0).sum()
    expected = np.linalg.solve(matrix, right.reshape(36, 2)).reshape(12, 3, 2)
    np.testing.assert_allclose(solution, expected, atol=1e-8)  # measured 4e-11


@PATHS
@pytest.mark.parametrize("count", [1, 2, 3, 12])
@pytest.mark.parametrize("seed", range(5))
def test_frames_tied_to_the_next_but_one_are_eliminated_too(path: ModuleType, count: int, seed: int) -> None:
    (diagonal, upper), rng = random_blocks(seed, count), np.random.default_rng(seed)
    beyond, matrix = rng.normal(size=(count, 3, 3)), dense(diagonal, upper)
    beyond[-2:] = 0.0
    for i in range(count - 2):
        matrix[3 * i : 3 * i + 3, 3 * i + 6 : 3 * i + 9] = beyond[i]
        matrix[3 * i + 6 : 3 * i + 9, 3 * i : 3 * i + 3] = beyond[i].T
    right = rng.normal(size=(count, 3, 2))
    solution = right.copy()
    assert path.eliminate(diagonal, upper, beyond, solution) == (np.linalg.eigvalsh(matrix) < 0).sum()
    expected = np.linalg.solve(matrix, right.reshape(-1, 2)).reshape(count, 3, 2)
    np.testing.assert_allclose(solution, expected, atol=1e-8)


@PATHS
@pytest.mark.parametrize("is_tied", [False, True])
@pytest.mark.parametrize("turning", [0.0, 0.3])
@pytest.mark.parametrize("columns", [0, 1, 7, 30])
@pytest.mark.parametrize("seed", range(5))
def test_the_complement_over_the_border_is_that_of_the_dense_matrix(
    path: ModuleType, seed: int, columns: int, turning: float, is_tied: bool
) -> None:
    (diagonal, upper), rng = random_blocks(seed), np.random.default_rng(seed)
    full, beyond = dense(diagonal, upper), np.zeros((12 if is_tied else 0, 3, 3))
    for i in range(10 if is_tied else 0):
        beyond[i] = rng.normal(size=(3, 3))
        full[3 * i : 3 * i + 3, 3 * i + 6 : 3 * i + 9] = beyond[i]
        full[3 * i + 6 : 3 * i + 9, 3 * i : 3 * i + 3] = beyond[i].T
    last, gradient = rng.integers(0, 12, columns), rng.normal(size=(12, 3))
    is_turn = rng.uniform(size=columns) < turning
    segment = np.arange(12)[:, None, None]
    matrix = np.where((segment == last) | ((segment < last) & ~is_turn), rng.normal(size=(12, 3, columns)), 0.0)
    matrix, compliance = np.ascontiguousarray(matrix), np.diag(rng.normal(size=columns))
    for row in np.flatnonzero(is_turn[1:]) + 1:
        if not is_turn[row - 1]:  # a row on the same segment, as an edge has it
            last[row] = last[row - 1]
            matrix[:, :, row] = np.where(segment[:, :, 0] == last[row], rng.normal(size=3), 0.0)
            compliance[row, row - 1] = compliance[row - 1, row] = rng.normal()
    found = path.complement(diagonal, upper, beyond, matrix, gradient, last, is_turn, compliance)
    flat, inverse = matrix.reshape(36, columns), np.linalg.inv(full)
    border, right = flat.T @ inverse @ flat + compliance, flat.T @ inverse @ gradient.ravel()
    kept, gone = found.kept, np.setdiff1d(np.arange(columns), found.kept)
    assert is_turn[gone].all()
    assert len(gone) == (0 if is_tied or path is numpy_path else len(set(last[is_turn])))
    between = border[np.ix_(gone, gone)]
    assert found.negative == (np.linalg.eigvalsh(full) < 0).sum() + (np.linalg.eigvalsh(between) > 0).sum()
    # Measured 4e-10, of all three; indefinite, elimination without pivoting.
    weights = np.linalg.solve(between, border[np.ix_(gone, kept)])
    np.testing.assert_allclose(found.matrix, border[np.ix_(kept, kept)] - border[np.ix_(kept, gone)] @ weights, atol=1e-8)
    np.testing.assert_allclose(found.right, right[kept] - weights.T @ right[gone], atol=1e-8)
    change = np.zeros(columns)
    change[kept] = rng.normal(size=len(kept))
    change[gone] = np.linalg.solve(between, right[gone]) - weights @ change[kept]
    expected = inverse @ (flat @ change - gradient.ravel())
    np.testing.assert_allclose(path.turns(found, change[kept]).ravel(), expected, atol=1e-8)
    assert path.work_of(diagonal, upper, beyond, expected.reshape(12, 3)) == pytest.approx(expected @ full @ expected, rel=1e-9, abs=1e-9)


@PATHS
@pytest.mark.parametrize("fixed", [0, 1, 5, 9])
@pytest.mark.parametrize("seed", range(5))
def test_a_condensed_system_has_the_solution_of_the_whole(path: ModuleType, seed: int, fixed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix, right, mixed = rng.normal(size=(12, 12)), rng.normal(size=12), rng.permutation(12)
    matrix = matrix + matrix.T
    matrix[2, 2] = 0.0  # pivots come in pairs
    gone, left = mixed[:fixed], mixed[fixed:]
    own, rest, solved, positive = path.condense(matrix, right, gone, left)
    expected = np.linalg.solve(matrix, right)
    np.testing.assert_allclose(np.linalg.solve(own, rest), expected[left], atol=1e-9)  # measured 1e-11
    np.testing.assert_allclose(solved[:, -1] - solved[:, :-1] @ expected[left], expected[gone], atol=1e-9)
    assert positive == (np.linalg.eigvalsh(matrix[np.ix_(gone, gone)]) > 0).sum()


@pytest.mark.parametrize("clamps", [[0, 4, 10], [4], []])
def test_compiled_ties_equal_their_numpy_twins(clamps: list[int]) -> None:
    sample = Sample()
    sample.clamp_of_node[:] = -1
    sample.clamp_of_node[clamps] = range(len(clamps))
    elastic = elastic_of(sample.elastic.law, sample.elastic.bent, sample.lengths, np.random.default_rng(2).uniform(size=(10, 2)))
    place = (sample.frames, sample.lengths, elastic, sample.clamp_of_node, sample.clamp_frames)
    energies = [path.smoothing_energy(*place) for path in (kernels, numpy_path)]
    np.testing.assert_allclose(*energies, rtol=1e-13)
    found = []
    for path in (kernels, numpy_path):
        blocks = [np.zeros((10, 3)), np.zeros((10, 3, 3)), np.zeros((10, 3, 3))]
        found.append([*blocks, path.add_smoothing(*place, *blocks)])
    for compiled, plain in zip(*found, strict=True):
        np.testing.assert_allclose(compiled, plain, atol=1e-12 * np.abs(plain).max())


@PATHS
def test_a_retracted_frame_is_the_frame_times_the_turn(path: ModuleType) -> None:
    sample = Sample()
    expected = (Rotation.from_quat(sample.frames) * Rotation.from_rotvec(sample.turn)).as_matrix()
    np.testing.assert_allclose(Rotation.from_quat(path.retract(sample.frames, sample.turn)).as_matrix(), expected, atol=1e-14)


@PATHS
def test_energy_of_a_circle_converges_to_the_exact_one_with_second_order(path: ModuleType) -> None:
    """EI/2 kappa^2 L of a closed circle of one metre, per vertex; the error falls by four when segments halve."""
    errors = []
    for count in (25, 50, 100):
        turns = Rotation.from_rotvec(np.outer(np.arange(count), [2 * np.pi / count, 0.0, 0.0]))
        free = np.full(count + 1, -1)
        lengths = np.full(count, 1 / count)
        ones = elastic_of(np.ones((count, 3)), np.zeros((count, 3)), lengths, NO_TIES)
        energy = path.elastic_energy(turns.as_quat(), lengths, ones, free, np.zeros((0, 4)))
        errors.append(energy / ((count - 1) / count * 0.5 * (2 * np.pi) ** 2) - 1)
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.1)
    assert errors[1] / errors[2] == pytest.approx(4.0, abs=0.03)


@PATHS
@pytest.mark.parametrize("count", [1, 2, 3, 7, 30])
def test_a_dense_symmetric_system_is_solved_and_its_positive_eigenvalues_are_counted(path: ModuleType, count: int) -> None:
    rng = np.random.default_rng(count)
    for zero_diagonal in (False, count > 1):
        matrix = rng.normal(size=(count, count))
        matrix += matrix.T
        if zero_diagonal:
            np.fill_diagonal(matrix, 0.0)
        right = rng.normal(size=(count, 3))
        solution, positive = path.solve_symmetric(matrix, right)
        assert positive == (np.linalg.eigvalsh(matrix) > 0).sum()
        expected = np.linalg.solve(matrix, right)
        np.testing.assert_allclose(solution, expected, atol=1e-9 * np.abs(expected).max())  # measured 2e-10; FLOOR is 1e-12


@PATHS
@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_a_dense_system_that_is_not_a_number_is_answered_with_none(path: ModuleType, count: int) -> None:
    """In a pivot search that compares, all comparisons fail: a pair with a row past the last one ended the process."""
    for share in (0, 1):
        matrix = np.eye(count)
        matrix[share * (count - 1) :, :] = np.nan
        solution, _ = path.solve_symmetric(matrix, np.ones((count, 1)))
        assert not np.isfinite(solution).all()


@PATHS
def test_frames_are_carried_over_to_another_mesh_with_fourth_order(path: ModuleType) -> None:
    """A curve with a bend that varies, in space; the frame between is off by the fourth power of the spacing."""
    errors = []
    for count in (20, 40):
        there, here = (np.arange(count) + 0.5) / count, (np.arange(2 * count) + 0.5) / (2 * count)
        frames = [Rotation.from_rotvec(np.column_stack([np.sin(3 * s), s**2, np.cos(2 * s)])).as_quat() for s in (there, here)]
        frames[0][::3] *= -1.0
        between = path.interpolate_frames(there, frames[0], here)
        errors.append((Rotation.from_quat(between).inv() * Rotation.from_quat(frames[1])).magnitude().max())
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.3)  # measured 15.0
