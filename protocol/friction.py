"""What does not go together in the friction of a body: numbers that its kind has no use for, or misses."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from .kinds import Friction

if TYPE_CHECKING:
    from .scene import Body

COEFFICIENT_MAX: Final = 100.0
TABLE_MAX: Final = 100  # speeds, or normal forces
NUMBERS: Final[dict[Friction, tuple[str, ...]]] = {
    Friction.REGULARIZED: ("friction_coefficient", "friction_speed"),
    Friction.SIGNUM: ("friction_coefficient",),
    Friction.DEFINED: ("friction_table", "friction_normals"),
}
"""The numbers that each kind of friction has; all but `friction_normals` are needed."""
ALL: Final = ("friction_coefficient", "friction_speed", "friction_table", "friction_normals")


def friction_mistakes(body: Body) -> Iterator[tuple[str, str]]:
    """What is missing, surplus or wrong: key and sentence, which begins with the key."""
    own, kind = NUMBERS.get(body.friction, ()), body.friction.value
    for name in ALL:
        is_given = getattr(body, name) not in (None, ())
        if is_given and name not in own:
            has = f"it has {' and '.join(repr(one) for one in own)}" if own else "it has no numbers"
            yield name, f"{name}: given for friction '{kind}'; {has}"
        if not is_given and name in own and name != "friction_normals":
            yield name, f"{name}: missing; friction '{kind}' needs it"
    if body.friction is Friction.DEFINED and body.friction_table:
        yield from _table_mistakes(body.friction_table, body.friction_normals)


def _table_mistakes(table: tuple[tuple[float, ...], ...], normals: tuple[float, ...]) -> Iterator[tuple[str, str]]:
    width = 1 + (len(normals) or 1)
    if len(table) > TABLE_MAX or len(normals) > TABLE_MAX:
        yield "friction_table", f"friction_table: has more than {TABLE_MAX} rows or columns; give fewer"
    elif any(len(row) != width for row in table):
        what = "a speed and a coefficient" if not normals else f"a speed and {len(normals)} forces, one for each of 'friction_normals'"
        yield "friction_table", f"friction_table: every row must have {what}"
    elif not all(0.0 <= value < math.inf for row in (*table, normals) for value in row):
        yield "friction_table", "friction_table: its numbers must be 0 or more, and finite"
    elif table[0][0] != 0.0 or any(after[0] <= before[0] for before, after in itertools.pairwise(table)):
        yield "friction_table", "friction_table: the speeds must begin with 0 and grow strictly"
    elif normals and (normals[0] <= 0.0 or any(after <= before for before, after in itertools.pairwise(normals))):
        yield "friction_normals", "friction_normals: must be positive and grow strictly"
