"""Moments of contact forces about the axis: a force on an edge or a vertex acts at the feature, not at the axis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .effects.contact import OneSided
    from .rod import View


@dataclass(frozen=True)
class Couples:
    """Moments of contact forces about the axis: the force acts at the feature, not at the axis."""

    row: np.ndarray  # (c,) int, contacts with a couple
    element: np.ndarray  # (c,) int, segments
    arm: np.ndarray  # (c, 2) m, change of the gap with the rotation of the segment about d1 and d2


def couples_of(touch: OneSided | None, view: View) -> Couples:
    """The couples of all contacts where they now are."""
    row = np.flatnonzero(view.numbers[:, 2])
    element = touch.element[row] if touch is not None else np.zeros(0, dtype=np.int64)
    first = np.einsum("ij,ij->i", view.normal[row], view.axes[element, 0])
    second = np.einsum("ij,ij->i", view.normal[row], view.axes[element, 1])
    return Couples(row, element, view.numbers[row, 2, None] * np.column_stack([-second, first]))


def add_couples(gradient: np.ndarray, couples: Couples, push: np.ndarray) -> None:
    """Add the couples of the forces `push` (m,) to a gradient (n-1, 3)."""
    np.add.at(gradient, (couples.element[:, None], np.array([0, 1])), push[couples.row, None] * couples.arm)
