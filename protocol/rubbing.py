"""How contacts with friction rub: their laws, where each was held, and what is left of that after a step.

The shape server has no memory, so a request says where every point of the cable that rubs was held on its body, already moved with the
body, and how long ago that was. The reply says where it is held now; whoever owns time carries that on to the next request.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from .checks import CONTACTS_MAX, EXTENT_MAX, HUGE, check_count, check_floats, check_integers, is_growing
from .errors import MessageError
from .friction import COEFFICIENT_MAX, TABLE_MAX
from .part import Part

LAWS_MAX: Final = 1000
TIME_STEP_MAX: Final = 1e6  # s


class FrictionTable(Part, frozen=True):
    """A law given as points: the force at any sliding speed and normal force is linear between them.

    Beyond the last speed it stays as it is; below the first normal force it falls to zero with it, beyond the last it goes on as before.
    """

    speeds: np.ndarray  # (k,) m/s, from 0, strictly increasing
    normals: np.ndarray  # (q,) N, positive, strictly increasing
    forces: np.ndarray  # (k, q) N, 0 or more

    def __post_init__(self) -> None:
        """Check shapes, ranges and order."""
        for name, values in (("speeds", self.speeds), ("normals", self.normals)):
            if not 0 < len(values) <= TABLE_MAX:
                raise MessageError(f"table.{name}: {len(values)} entries must be 1 to {TABLE_MAX}", key=f"table.{name}")
            check_floats(f"table.{name}", values, (len(values),), HUGE)
            if not is_growing(values):
                raise MessageError(f"table.{name}: must grow strictly", key=f"table.{name}")
        check_floats("table.forces", self.forces, (len(self.speeds), len(self.normals)), HUGE)
        if self.speeds[0] != 0.0 or self.normals[0] <= 0.0 or self.forces.min() < 0.0:
            raise MessageError("table: speeds begin at 0, normal forces are positive, and forces are 0 or more", key="table")


class FrictionLaw(Part, frozen=True):
    """The numbers of a law of friction; which kind it is says the contact."""

    coefficient: float = 0.0  # mu
    speed: float = 0.0  # m/s, v0 of the regularized law
    table: FrictionTable | None = None  # of the defined law

    def __post_init__(self) -> None:
        """Check ranges."""
        if not 0.0 <= self.coefficient <= COEFFICIENT_MAX:
            raise MessageError(f"coefficient: {self.coefficient!r} must lie within 0 and {COEFFICIENT_MAX:g}", key="coefficient")
        if not 0.0 <= self.speed < HUGE:
            raise MessageError(f"speed: {self.speed!r} m/s must be 0 or more, and finite", key="speed")


class Rubbing(Part, frozen=True):
    """The contacts of a request that rub, one row each."""

    contact: np.ndarray  # (f,) int, which contact of the request; strictly increasing
    law: np.ndarray  # (f,) int, which of `laws`
    s: np.ndarray  # (f,) m, arc length of the point of the cable that is held
    anchor: np.ndarray  # (f, 3) m, where on the body this point of the axis was held, moved with the body since
    laws: tuple[FrictionLaw, ...]
    time_step: float  # s, since it was held there

    def __post_init__(self) -> None:
        """Check shapes and ranges."""
        count = len(self.s)
        check_count("rubbing", count, CONTACTS_MAX)
        check_count("rubbing.laws", len(self.laws), LAWS_MAX)
        check_integers("rubbing.contact", self.contact, count, 0, CONTACTS_MAX)
        check_integers("rubbing.law", self.law, count, 0, len(self.laws) - 1)
        check_floats("rubbing.s", self.s, (count,), EXTENT_MAX)
        check_floats("rubbing.anchor", self.anchor, (count, 3), EXTENT_MAX)
        if not is_growing(self.contact):
            raise MessageError("rubbing.contact: must grow strictly", key="rubbing.contact")
        if not 0.0 < self.time_step < TIME_STEP_MAX:
            raise MessageError(f"rubbing.time_step: {self.time_step!r} s must be positive and finite", key="rubbing.time_step")


class Rubbed(Part, frozen=True):
    """What is left of the contacts that rub, one row for each of the request's; the next request holds what pushes from there."""

    s: np.ndarray  # (f,) m, arc length of the point of the cable that is held
    anchor: np.ndarray  # (f, 3) m, where it is held: as before if it sticks, where it has slid to otherwise
    is_sticking: np.ndarray  # (f,) int, 1 if it sticks, 0 if it slides or does not touch

    def __post_init__(self) -> None:
        """Check shapes and ranges."""
        count = len(self.s)
        check_count("rubbed", count, CONTACTS_MAX)
        check_floats("rubbed.s", self.s, (count,), EXTENT_MAX)
        check_floats("rubbed.anchor", self.anchor, (count, 3), EXTENT_MAX)
        check_integers("rubbed.is_sticking", self.is_sticking, count, 0, 1)
