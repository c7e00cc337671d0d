"""Four numbers of a row at once, against NumPy."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from shape_server.fours import add_four, set_four


@numba.njit
def setting(out, to, source, at, stride, factors):  # type: ignore[no-untyped-def]
    set_four(out, to, source, at, stride, factors[0], factors[1], factors[2])


@numba.njit
def adding(out, to, source, at, stride, factors):  # type: ignore[no-untyped-def]
    add_four(out, to, source, at, stride, factors[0], factors[1], factors[2])


@pytest.mark.parametrize("seed", range(3))
def test_three_rows_are_combined_into_four_numbers(seed: int) -> None:
    """Odd places too, where vectors of the processor are not aligned; no other number changes."""
    random = np.random.default_rng(seed)
    for write, keeps in ((setting, 0.0), (adding, 1.0)):
        out, source, factors = random.normal(size=(5, 7)), random.normal(size=(2, 3, 9)), random.normal(size=3)
        to, at, expected = int(random.integers(0, 31)), int(random.integers(0, 33)), out.copy()
        rows = np.array([source.ravel()[at + 9 * k : at + 9 * k + 4] for k in range(3)])
        expected.ravel()[to : to + 4] = keeps * out.ravel()[to : to + 4] + factors @ rows
        write(out, to, source, at, 9, factors)
        np.testing.assert_allclose(out, expected, rtol=0, atol=1e-14)  # measured 0


def test_only_arrays_without_gaps_are_taken() -> None:
    with pytest.raises(TypeError, match="C-contiguous arrays of floats"):
        setting(np.zeros((8, 8))[:, ::2], 0, np.zeros(12), 0, 4, np.zeros(3))
