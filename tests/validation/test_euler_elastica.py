"""The straight rod pressed between two clamps: Euler 1744.

Source: Euler 1744, "Methodus inveniendi lineas curvas", Additamentum I; Love 1944, "A treatise on the mathematical theory of
elasticity", 4th ed., secs. 262-263.

Claim: clamped ends pushed together by L - c along their common tangent bend a rod without weight to an elastica with
2 E(k) / K(k) - 1 = c / L, pressed by 16 K(k)^2 EI / L^2 (4 pi^2 EI / L^2 at first), with the amplitude L k / K(k). Checked with solve_bvp.
The shape with two waves in place of one is in equilibrium too, at four times the force, and not stable.
The rod is round, so that it may bow in any plane through its ends.
"""

from __future__ import annotations

import numpy as np
import pytest
from heavy_elastica import planar
from posed import ask, cable, frame, grasps
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from protocol.kinds import Hold, Outcome
from protocol.messages import Grasps, Shape, Start

LEVEL = frame((1.0, 0.0, 0.0))
ROD = cable(bending=1.0, weight=0.0)
CHORDS = (0.999999, 0.9999, 0.99, 0.9, 0.7, 0.5)  # m

each_chord = pytest.mark.parametrize("chord", CHORDS)


def modulus(chord: float) -> float:
    """The parameter m = k^2 of the elliptic integrals."""
    return float(brentq(lambda m: 2 * ellipe(m) / ellipk(m) - 1 - chord, 1e-15, 0.9, xtol=1e-16))


def thrust(chord: float) -> float:
    """[N] For EI = 1 N m^2 and L = 1 m."""
    return float(16 * ellipk(modulus(chord)) ** 2)


def amplitude(chord: float) -> float:
    """[m] For L = 1 m."""
    return float(np.sqrt(modulus(chord)) / ellipk(modulus(chord)))


def held(chord: float) -> Grasps:
    return grasps((0.0, (0.0, 0.0, 0.0), LEVEL, Hold.CLAMP), (1.0, (chord, 0.0, 0.0), LEVEL, Hold.CLAMP))


def slope(chord: float, s: np.ndarray, waves: int = 1) -> np.ndarray:
    """Near the exact slope; exact to the first order in k."""
    return 2 * np.arcsin(np.sqrt(modulus(chord)) * np.sin(2 * np.pi * waves * s))


def pressed(chord: float, segments: int, waves: int = 1) -> Shape:
    s = np.linspace(0.0, 1.0, segments + 1)
    frames = np.array([frame((np.cos(a), 0.0, np.sin(a))) for a in slope(chord, (s[1:] + s[:-1]) / 2, waves)])
    force = thrust(chord) * waves**2
    return ask(ROD, held(chord), start=Start(s=s, frames=frames, grasp_forces=np.array([[force, 0.0, 0.0], [-force, 0.0, 0.0]])))


def bow(shape: Shape) -> float:
    """[m] Distance of the middle from the chord, in whatever plane."""
    return float(np.hypot(*shape.nodes[(len(shape.s) - 1) // 2, 1:]))


@pytest.mark.sampled(2)
@each_chord
def test_the_closed_form_solves_the_differential_equation(chord: float) -> None:
    found = planar(
        bending=1.0,
        weight=0.0,
        length=1.0,
        start=(0.0, 0.0, 0.0),
        end=(chord, 0.0, 0.0),
        slope=lambda s: slope(chord, s),
        force=(-thrust(chord), 0.0),
    )
    assert -found.force[0] == pytest.approx(thrust(chord), rel=1e-9)  # measured 7e-11
    assert found.positions(np.array([0.5]))[0, 2] == pytest.approx(amplitude(chord), rel=1e-9)  # measured 7e-11


def test_the_first_thrust_is_that_of_euler() -> None:
    assert thrust(1 - 1e-9) == pytest.approx(4 * np.pi**2, rel=1e-8)


@each_chord
def test_the_pressed_rod_bows_as_the_elastica_and_is_stable(chord: float) -> None:
    """Just beyond the first thrust the rod has next to no stiffness sideways, and Newton's method ends early."""
    shape = pressed(chord, 200)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert shape.is_stable
    assert bow(shape) == pytest.approx(amplitude(chord), rel=1e-4, abs=1e-6)  # m; measured 5.1e-5 (chord 0.5) and 5.8e-7 m (0.9999)
    assert shape.grasp_wrenches[0, 0] == pytest.approx(thrust(chord), rel=1e-4)  # measured -8.2e-5 (0.999999) to 6.8e-5 (0.5)


@pytest.mark.parametrize("chord", [0.99, 0.9, 0.7, 0.5])
def test_the_bow_converges_with_order_two(chord: float) -> None:
    bows = np.array([bow(pressed(chord, segments)) for segments in (50, 100, 200)]) / amplitude(chord) - 1
    assert np.log2(bows[:-1] / bows[1:]) == pytest.approx(2.0, abs=0.05)  # measured 1.996 to 2.032


@pytest.mark.parametrize("chord", [0.999999, 0.99])
def test_the_thrust_converges_with_order_two(chord: float) -> None:
    thrusts = np.array([pressed(chord, segments).grasp_wrenches[0, 0] for segments in (50, 100, 200)]) / thrust(chord) - 1
    assert np.log2(thrusts[:-1] / thrusts[1:]) == pytest.approx(2.0, abs=0.02)  # measured 1.999 to 2.002


@pytest.mark.parametrize("chord", [0.99, 0.9, 0.7])
def test_two_waves_are_not_returned_as_stable(chord: float) -> None:
    shape = pressed(chord, 100, waves=2)
    assert shape.outcome is not Outcome.CONVERGED or np.linalg.norm(shape.grasp_wrenches[0, :3]) < 2 * thrust(chord)


@each_chord
def test_a_cold_start_finds_a_stable_shape(chord: float) -> None:
    """Bowed in a plane, or with a loop: both are stable, so only a balance is asked for."""
    shape = ask(ROD, held(chord))
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert shape.is_stable
    assert np.abs(shape.grasp_wrenches[:, :3].sum(0)).max() < 1e-9  # N
