"""The cable without stiffness: a catenary, from its end forces instead of its parameter.

Source: Irvine 1981, "Cable structures", MIT Press, ch. 1 (inextensible limit of the catenary in terms of the end forces).

Claim: with the horizontal force H and the vertical force V(s) = V_0 + w s, the cable is at
x(s) = H/w (asinh(V/H) - asinh(V_0/H)), z(s) = (sqrt(H^2 + V^2) - sqrt(H^2 + V_0^2)) / w.
The rise h of the far end fixes the mean vertical force, V_m = h sqrt(H^2 / (L^2 - h^2) + w^2 / 4), and the span fixes H. Solved
here by bisection with 60 digits, so that a nearly taut cable is no harder than a slack one; checked with the relation
sinh(a)/a = sqrt(L^2 - h^2) / span, a = w span / 2H, that textbooks start from.

A bonded point holds the cable where it touches and splits it in two catenaries; a bond does not pull.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal, localcontext
from functools import cache

import numpy as np
import pytest
from posed import ask, cable, frame, grasps, touches, unbalance

from protocol.kinds import Feature, Friction, Hold, Outcome
from protocol.messages import Contacts, Grasps, Shape

DIGITS = 60
LEVEL = frame((1.0, 0.0, 0.0))
UPWARD = (0.0, 0.0, 1.0)
NOWHERE = (0.0, 0.0, 0.0)
TAUT = 1 / (1 + 1e-8)
ENDS = {
    "level": (0.7, 0.0, 0.0),
    "unequal heights, askew": (0.6, 0.3, 0.4),
    "falling": (0.5, 0.0, -0.7),
    "deep slack": (0.01, 0.0, 0.0),
    "deep slack, unequal heights": (0.0, 1e-3, 0.5),
    "nearly taut": (TAUT, 0.0, 0.0),
    "nearly taut, rising": (0.8 * TAUT, 0.0, 0.6 * TAUT),
}
each_end = pytest.mark.parametrize("name", ENDS)


def asinh(x: Decimal) -> Decimal:
    size = abs(x)
    return ((size + (size * size + 1).sqrt()).ln()).copy_sign(x)


@dataclass(frozen=True)
class Catenary:
    """One metre or less of cable that weighs 1 N/m, from one point to another."""

    begin: np.ndarray  # (3,) m
    heading: np.ndarray  # (3,) horizontal unit vector from begin to end
    horizontal: Decimal  # N
    vertical: Decimal  # N, at the beginning; on the part before from the part beyond

    def positions(self, s: np.ndarray) -> np.ndarray:
        """(k, 3) [m]."""
        return np.array([self._position(Decimal(float(at))) for at in s])

    def _position(self, s: Decimal) -> np.ndarray:
        with localcontext() as digits:
            digits.prec = DIGITS
            H, first, here = self.horizontal, self.vertical, self.vertical + s
            x = H * (asinh(here / H) - asinh(first / H))
            z = (H * H + here * here).sqrt() - (H * H + first * first).sqrt()
            return self.begin + float(x) * self.heading + np.array([0.0, 0.0, float(z)])

    def end_forces(self, length: float) -> np.ndarray:
        """(2, 3) [N] On the cable."""
        level = float(self.horizontal) * self.heading
        up = np.array([0.0, 0.0, 1.0])
        return np.array([-level - float(self.vertical) * up, level + (float(self.vertical) + length) * up])


def hanging(begin: np.ndarray, end: np.ndarray, length: float) -> Catenary:
    with localcontext() as digits:
        digits.prec = DIGITS
        across, rise, L = (Decimal(float(v)) for v in (np.hypot(*(end - begin)[:2]), (end - begin)[2], length))

        def first_vertical(H: Decimal) -> Decimal:
            return rise * (H * H / (L * L - rise * rise) + Decimal("0.25")).sqrt() - L / 2

        def span(H: Decimal) -> Decimal:
            return H * (asinh((first_vertical(H) + L) / H) - asinh(first_vertical(H) / H))

        low, high = Decimal("1e-12"), Decimal("1e9")
        for _ in range(220):
            middle = (low * high).sqrt()
            low, high = (middle, high) if span(middle) < across else (low, middle)
        heading = (end - begin) * np.array([1.0, 1.0, 0.0])
        return Catenary(begin, heading / np.linalg.norm(heading), low, first_vertical(low))


@cache
def reference(name: str) -> Catenary:
    return hanging(np.zeros(3), np.array(ENDS[name]), 1.0)


def held(end: tuple[float, float, float]) -> Grasps:
    return grasps((0.0, (0.0, 0.0, 0.0), LEVEL, Hold.HINGE), (1.0, end, LEVEL, Hold.HINGE))


def hung(name: str) -> Shape:
    shape = ask(cable(), held(ENDS[name]))
    assert shape.outcome is Outcome.CONVERGED
    assert shape.model == "catenary"
    return shape


@each_end
def test_the_reference_obeys_the_relation_of_the_textbooks(name: str) -> None:
    x, y, rise = ENDS[name]
    span, a = np.hypot(x, y), np.hypot(x, y) / 2 / float(reference(name).horizontal)
    # L^2 - h^2 - span^2, without cancelling, against a^2 (sinh(a)/a)^2 = a^2 + a^4/3 + ...
    excess = (1 - rise * rise - span * span) / span**2
    small = a * a / 3 + 2 * a**4 / 45
    assert (small if a < 1e-2 else (np.sinh(a) / a) ** 2 - 1) == pytest.approx(excess, rel=1e-7)  # 1 - chord^2 has 8 digits when taut
    assert reference(name).positions(np.array([1.0]))[0] == pytest.approx(ENDS[name], abs=1e-15)


@each_end
def test_the_cable_hangs_as_a_catenary(name: str) -> None:
    shape = hung(name)
    assert np.abs(shape.nodes - reference(name).positions(shape.s)).max() < 1e-9  # m; measured 1.1e-16 to 1.4e-13


@each_end
def test_the_end_forces_are_those_of_the_catenary(name: str) -> None:
    wanted = reference(name).end_forces(1.0)
    assert hung(name).grasp_wrenches[:, :3] == pytest.approx(
        wanted, rel=1e-7, abs=1e-9
    )  # measured 1e-17, and 1.1e-9 when nearly taut and rising: 1 - chord has 8 digits


@pytest.mark.parametrize("name", [name for name in ENDS if "deep" not in name])
def test_tension_grows_by_the_weight_per_height(name: str) -> None:
    """T = w z + constant along a catenary; T in a segment, z at its middle along the curve.

    Not where the cable turns within one segment, as it does when it hangs deep: T is that of the segment there.
    """
    shape = hung(name)
    middle = reference(name).positions((shape.s[1:] + shape.s[:-1]) / 2)[:, 2]
    assert np.ptp(shape.tension - middle) < 1e-3  # N; measured 8.1e-4 on segments of 4 cm


@pytest.mark.parametrize("rise", [0.0, 0.5, -0.3])
def test_a_cable_held_at_two_points_above_each_other_hangs_double(rise: float) -> None:
    """Both strands hang straight down; the lower turn is (L - |rise|) / 2 below the lower end."""
    shape = ask(cable(), held((0.0, 0.0, rise)))
    turn = (1 - rise) / 2  # m, arc length of the lowest point
    wanted = np.where(shape.s < turn, -shape.s, shape.s - 2 * turn)
    assert shape.outcome is Outcome.CONVERGED
    assert shape.nodes[:, 2] == pytest.approx(wanted, abs=1e-12)
    assert shape.grasp_wrenches[:, 2] == pytest.approx([turn, 1 - turn], abs=1e-12)


def test_a_free_end_hangs_straight_down() -> None:
    shape = ask(cable(), grasps((0.3, (0.0, 0.0, 0.0), LEVEL, Hold.HINGE), (0.8, (0.3, 0.0, 0.0), LEVEL, Hold.HINGE)))
    assert shape.nodes[[0, -1]] == pytest.approx(np.array([[0.0, 0.0, -0.3], [0.3, 0.0, -0.2]]), abs=1e-12)


def bond(s: float, point: tuple[float, float, float]) -> Contacts:
    return touches((s, Feature.FACE, point, UPWARD, NOWHERE), distance=0.0045, friction=Friction.BOND)


@pytest.mark.parametrize(("s", "point"), [(0.5, (0.35, 0.0, -0.1)), (0.4, (0.3, 0.05, -0.2)), (0.25, (0.1, 0.0, 0.1))])
def test_a_bonded_point_splits_the_cable_in_two_catenaries(s: float, point: tuple[float, float, float]) -> None:
    end = np.array(ENDS["level"])
    touch = np.array(point) + 0.0045 * np.array(UPWARD)
    left, right = hanging(np.zeros(3), touch, s), hanging(touch, end, 1 - s)
    shape = ask(cable(), held(ENDS["level"]), contacts=bond(s, point))
    assert shape.outcome is Outcome.CONVERGED
    first = shape.s < s
    assert np.abs(shape.nodes[first] - left.positions(shape.s[first])).max() < 1e-9  # m; measured 1e-16
    assert np.abs(shape.nodes[~first] - right.positions(shape.s[~first] - s)).max() < 1e-9  # m; measured 1e-16
    wanted = left.end_forces(s)[1] + right.end_forces(1 - s)[0]
    assert wanted[2] > 0  # the body pushes
    assert shape.contact_forces[0] == pytest.approx(wanted, abs=1e-9)  # N
    assert unbalance(cable(), shape, held(ENDS["level"]))[0] < 1e-12


def test_a_bond_that_would_pull_is_dropped() -> None:
    free = hung("level")
    shape = ask(cable(), held(ENDS["level"]), contacts=bond(0.5, (0.35, 0.0, -0.35)))  # the cable hangs to -0.319 m
    assert shape.outcome is Outcome.CONVERGED
    assert not shape.contact_forces.any()
    assert shape.grasp_wrenches == pytest.approx(free.grasp_wrenches, abs=1e-12)
    assert np.abs(shape.nodes - reference("level").positions(shape.s)).max() < 1e-9


def test_ends_further_apart_than_the_cable_is_long_are_unreachable() -> None:
    assert ask(cable(), held((1.0001, 0.0, 0.0))).outcome is Outcome.UNREACHABLE
