"""Where cables touch each other, or one sticks to itself or rubs on itself: what a request asks about, and what the reply says of it.

These contacts belong to two cables of a request at once, and therefore to the request, not to a problem. Of a row the first cable bears the
force, the second its opposite, on one line: what a pair of cables does to each other neither moves nor turns it as a whole.
"""

from __future__ import annotations

import numpy as np

from .checks import CONTACTS_MAX, EXTENT_MAX, GRASPS_MAX, HUGE, check_count, check_floats, check_integers, check_units
from .errors import MessageError
from .friction import COEFFICIENT_MAX
from .kinds import SelfTouch
from .part import Part


class Crossings(Part, frozen=True):
    """Places where two cables touch or may do so, or where one sticks to itself, one row each; see `SelfTouch` for the kinds."""

    cable: np.ndarray  # (k, 2) int, problems of the request; the same one twice of places where it sticks to itself or rubs on itself
    s: np.ndarray  # (k, 2) m, arc lengths of both places
    kind: np.ndarray  # (k,) int, a `SelfTouch`
    normal: np.ndarray  # (k, 3) unit, from the second place to the first: which cable is on which side
    distance: np.ndarray  # (k,) m, between the axes when they touch
    force: np.ndarray  # (k, 3) N, on the first cable, and against it on the second; what to start from
    arm: np.ndarray  # (k, 6) m, where they stick or rub: from each axis to the common point, in the directors there; else zero
    mu: np.ndarray  # (k,) coefficient of Coulomb's friction where they touch; zero without, and where they stick
    held: np.ndarray  # (k, 2) m, arc lengths of the points that were held together by friction; of no meaning without
    drag: np.ndarray  # (k, 3) N, friction on the first cable, and against it on the second; what to start from

    def __post_init__(self) -> None:
        """Check shapes and ranges."""
        count = len(self.kind)
        check_count("crossings", count, CONTACTS_MAX)
        check_integers("crossings.kind", self.kind, count, 0, len(SelfTouch) - 1)
        if self.cable.shape != (count, 2):
            raise MessageError(f"crossings.cable: shape {self.cable.shape} must be ({count}, 2)", key="crossings.cable")
        check_integers("crossings.cable", self.cable.ravel(), 2 * count, 0, GRASPS_MAX - 1)
        check_floats("crossings.s", self.s, (count, 2), EXTENT_MAX)
        check_floats("crossings.normal", self.normal, (count, 3), EXTENT_MAX)
        check_floats("crossings.distance", self.distance, (count,), EXTENT_MAX)
        check_floats("crossings.force", self.force, (count, 3), 1e9)
        check_floats("crossings.arm", self.arm, (count, 6), EXTENT_MAX)
        check_floats("crossings.mu", self.mu, (count,), COEFFICIENT_MAX)
        check_floats("crossings.held", self.held, (count, 2), EXTENT_MAX)
        check_floats("crossings.drag", self.drag, (count, 3), 1e9)
        check_units("crossings.normal", self.normal)
        if (self.mu < 0.0).any() or self.mu[self.kind == SelfTouch.BOND].any():
            what = "crossings.mu: must be 0 or more where cables touch, and 0 where they stick"
            raise MessageError(what, key="crossings.mu")
        is_without_arm = (self.arm.reshape(count, 2, 3) == 0.0).all(axis=2).any(axis=1)
        if is_without_arm[(self.mu > 0.0) | (self.kind == SelfTouch.BOND)].any():
            raise MessageError("crossings.arm: must not be zero where cables stick or rub", key="crossings.arm")


class CrossingReactions(Part, frozen=True):
    """What cables do to each other, in the order of the request's crossings."""

    s: np.ndarray  # (k, 2) m, where both places have slid to
    force: np.ndarray  # (k, 3) N, on the first cable; the opposite acts on the second
    point: np.ndarray  # (k, 3) m, where it acts
    gap: np.ndarray  # (k,) m; of places that stick, how far they are off each other
    drag: np.ndarray  # (k, 3) N, friction, a part of `force`
    lag: np.ndarray  # (k, 3) m, from the second of two held points to the first, where they are held from now on
    is_sticking: np.ndarray  # (k,) int, 1 if friction holds the points that it held, 0 if they slide or nothing rubs

    def __post_init__(self) -> None:
        """Check shapes and ranges."""
        count = len(self.s)
        check_floats("crossings.drag", self.drag, (count, 3), HUGE)
        check_floats("crossings.lag", self.lag, (count, 3), EXTENT_MAX)
        check_integers("crossings.is_sticking", self.is_sticking, count, 0, 1)
        check_floats("crossings.s", self.s, (count, 2), EXTENT_MAX)
        check_floats("crossings.force", self.force, (count, 3), HUGE)
        check_floats("crossings.point", self.point, (count, 3), EXTENT_MAX)
        check_floats("crossings.gap", self.gap, (count,), EXTENT_MAX)


class CablePoints(Part, frozen=True):
    """Places where cables push each other or stick together in a frame, one row each."""

    cable: np.ndarray  # (c, 2) int, indices of the cables
    s: np.ndarray  # (c, 2) m, arc lengths
    point: np.ndarray  # (c, 3) m
    force: np.ndarray  # (c, 3) N, on the first cable

    def __post_init__(self) -> None:
        """Check shapes and ranges."""
        count = len(self.s)
        check_integers("crossing.cable", np.ascontiguousarray(self.cable.ravel()), 2 * count, 0, GRASPS_MAX)
        check_floats("crossing.s", self.s, (count, 2), EXTENT_MAX)
        check_floats("crossing.point", self.point, (count, 3), EXTENT_MAX)
        check_floats("crossing.force", self.force, (count, 3), HUGE)


def check_crossings(crossings: Crossings, lengths: tuple[float, ...]) -> None:
    """Check that every row names cables that there are, of these lengths [m], and places on them."""
    if not len(crossings.kind):
        return
    if crossings.cable.max() >= len(lengths):
        raise MessageError(f"crossings.cable: {crossings.cable.max()} must be below {len(lengths)}, the problems", key="crossings.cable")
    for name, s in (("s", crossings.s), ("held", crossings.held)):
        if (s < 0.0).any() or (s > np.array(lengths)[crossings.cable]).any():
            raise MessageError(f"crossings.{name}: must lie from 0 to the length of the cable", key=f"crossings.{name}")
