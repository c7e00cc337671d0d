"""Is it stable? Answered by conjugate points, without a matrix of second derivatives.

Source: Hoffman 2004, "Stability results for constrained calculus of variations problems: an analysis of the twisted elastic
loop", Proceedings of the Royal Society A 461, 1357-1381; Manning, Rogers & Maddocks 1998, "Isoperimetric conjugate points with
application to the stability of DNA minicircles", Proceedings of the Royal Society A 454, 3047-3074.

Claim: an equilibrium of a rod clamped at both ends is stable if the 6 x 6 derivative of place and turn at s, by force and
moment at s = 0, stays regular for 0 < s <= L, and is not if the determinant changes its sign. An answer that the solver calls
stable must pass; the pressed rod with two waves, known not to be stable, must not.
"""

from __future__ import annotations

import numpy as np
import pytest
from posed import ask
from scipy.integrate import solve_ivp
from scipy.special import ellipk
from test_balance import posed
from test_euler_elastica import LEVEL, ROD, modulus, thrust

from protocol.scene import Cable

STEP = 1e-5
STATIONS = np.linspace(0.04, 1.0, 97)  # over length; closer to the first clamp the determinant is tiny, and positive


def determinants(rod: Cable, place: np.ndarray, quaternion: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """(97,) Determinants over the powers of s that all rods share, by marching the rod and twelve disturbed neighbours at once."""
    assert rod.bending is not None
    assert rod.twist is not None
    weight, force = rod.mass_per_length * 9.81, rod.bending / rod.length**2
    unit = np.array([force] * 3 + [force * rod.length] * 3)
    wrenches = wrench + np.vstack([STEP * np.diag(unit), -STEP * np.diag(unit)])  # (12, 6)

    def rhs(_: float, flat: np.ndarray) -> np.ndarray:
        y = flat.reshape(12, 13)
        x, e = y[:, 3:6], y[:, 6:7]
        d3 = np.column_stack(
            [
                2 * (x[:, 0] * x[:, 2] + x[:, 1] * y[:, 6]),
                2 * (x[:, 1] * x[:, 2] - x[:, 0] * y[:, 6]),
                1 - 2 * (x[:, 0] ** 2 + x[:, 1] ** 2),
            ]
        )
        along = (y[:, 10:] * d3).sum(1, keepdims=True)
        spin = y[:, 10:] / rod.bending + along * d3 * (1 / rod.twist - 1 / rod.bending)
        turn = np.column_stack([0.5 * (e * spin + np.cross(spin, x)), -0.5 * (spin * x).sum(1)])
        return np.column_stack([d3, turn, np.tile([0.0, 0.0, weight], (12, 1)), -np.cross(d3, y[:, 7:10])]).ravel()

    start = np.column_stack([np.tile(np.concatenate([place, quaternion]), (12, 1)), wrenches]).ravel()
    found = solve_ivp(rhs, (0.0, rod.length), start, method="DOP853", rtol=1e-10, atol=1e-12, t_eval=STATIONS * rod.length)
    y = found.y.T.reshape(len(STATIONS), 12, 13)
    change = (y[:, :6, :7] - y[:, 6:, :7]) / (2 * STEP)
    middle = (y[:, :6, 3:7] + y[:, 6:, 3:7]) / 2
    v, w, dv, dw = middle[..., :3], middle[..., 3:], change[..., 3:6], change[..., 6:]
    turned = 2 * (dv * w - v * dw + np.cross(v, dv))  # (97, 6, 3) rotation vectors
    scaled = np.concatenate([change[..., :3] / rod.length, turned], axis=2) / STATIONS[:, None, None]
    return np.linalg.det(scaled)


@pytest.mark.parametrize("seed", [2, 3, 4, 7, 9, 11, 14, 24])
def test_an_answer_called_stable_has_no_conjugate_point(seed: int) -> None:
    rod, held = posed(seed)
    shape = ask(rod, held, tolerance=1e-6 * rod.length)
    assert shape.is_stable
    signs = np.sign(determinants(rod, held.position[0], held.quaternion[0], -shape.grasp_wrenches[0]))
    assert (signs == signs[0]).all()


@pytest.mark.parametrize(("waves", "stable"), [(1, True), (2, False)])
def test_the_criterion_tells_one_wave_of_the_pressed_rod_from_two(waves: int, stable: bool) -> None:
    """Up to nine tenths of the rod: at its end a round rod without weight is free to turn about the line of its clamps."""
    chord = 0.9
    k, root = np.sqrt(modulus(chord)), 4 * waves * ellipk(modulus(chord))  # root: sqrt(thrust) for EI = 1
    wrench = np.array([-thrust(chord) * waves**2, 0.0, 0.0, 0.0, -2 * k * root, 0.0])  # on the part before, at s = 0
    signs = np.sign(determinants(ROD, np.zeros(3), LEVEL, wrench))[STATIONS < 0.9]
    assert (signs == signs[0]).all() == stable
