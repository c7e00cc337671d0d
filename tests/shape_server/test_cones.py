"""The interior point method for contacts with Coulomb's friction: the laws, by brute force, where exchanges go round in circles too."""

from __future__ import annotations

import numpy as np
import pytest
from rods import KERNELS

from shape_server import numpy_path
from shape_server.cones import interior
from shape_server.rod import NO_RUB, RUB, Rub

HARD = 1e-7


def problem(seed: int, count: int, spread: float) -> tuple[np.ndarray, np.ndarray, Rub]:
    """A positive matrix of contacts whose rows are nearly the same, as beside each other on a stiff cable, and loads."""
    rng = np.random.default_rng(seed)
    some = rng.normal(size=(max(3, count // 2), 3 * count))
    smooth = np.exp(-((np.arange(count)[:, None] - np.arange(count)) ** 2) / (2 * spread**2))
    some = (some.reshape(len(some), count, 3).transpose(0, 2, 1) @ smooth).transpose(0, 2, 1)
    # Rows of normal forces first, then two of every contact.
    order = np.concatenate([3 * np.arange(count), np.stack([3 * np.arange(count) + 1, 3 * np.arange(count) + 2], axis=1).ravel()])
    some = some.reshape(len(some), -1)[:, order]
    rows = np.zeros(count, dtype=RUB)
    rows["coefficient"], rows["table"] = rng.uniform(0.1, 1.0), -1
    right = np.concatenate([1e-3 * rng.uniform(-1.0, 3.0, count), 1e-3 * rng.normal(size=2 * count)])
    return 1e-3 * some.T @ some + HARD * np.eye(3 * count), right, Rub(rows, NO_RUB.tables, 1.0)


def worst(matrix: np.ndarray, right: np.ndarray, rub: Rub, force: np.ndarray) -> float:
    """Largest miss of a law: of a gap or slip over the largest load, of a force over the largest force."""
    many = len(rub.rows)
    apart, length, size = matrix @ force - right, np.abs(right).max(), np.abs(force).max()
    normal, along, slip = force[:many], force[many:].reshape(-1, 2), apart[many:].reshape(-1, 2)
    limit, pull, far = rub.rows["coefficient"] * normal, np.linalg.norm(along, axis=1), np.linalg.norm(slip, axis=1)
    misses = [-normal.min() / size, -apart[:many].min() / length, np.minimum(normal / size, apart[:many] / length).max()]
    misses += [((pull - limit) / size).max(), np.minimum((limit - pull) / size, far / length).max()]
    misses.append((np.einsum("fx,fx->f", along, slip) + pull * far).max() / (size * length))
    return float(max(misses))


@pytest.mark.parametrize("count", [1, 2, 5, 12, 30])
@pytest.mark.parametrize("seed", range(6))
def test_forces_keep_the_laws_of_coulomb_and_of_contact(seed: int, count: int) -> None:
    matrix, right, rub = problem(seed, count, 1.5)
    force, _, is_solved = KERNELS.stick_slip(matrix, right, np.arange(count), rub, HARD, np.zeros(3 * count))
    assert is_solved
    assert worst(matrix, right, rub, force) < 1e-7


@pytest.mark.slow
def test_the_interior_point_method_alone_comes_near_them() -> None:
    for seed in range(8):
        matrix, right, rub = problem(seed, 20, 2.0)
        mu = np.ascontiguousarray(rub.rows["coefficient"])
        force, is_found = interior(matrix, right, np.arange(20), mu, np.zeros(60), 1.0)
        assert is_found
        assert worst(matrix, right, rub, force) < 1e-3


def test_both_paths_find_the_same() -> None:
    matrix, right, rub = problem(2, 6, 1.5)
    found = [path.stick_slip(matrix, right, np.arange(6), rub, HARD, np.zeros(18)) for path in (KERNELS, numpy_path)]
    np.testing.assert_allclose(found[0][0], found[1][0], rtol=1e-6, atol=1e-9)
    assert np.array_equal(found[0][1], found[1][1])
