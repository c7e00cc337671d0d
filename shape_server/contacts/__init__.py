"""One file for each law of friction: the numbers that it gives to `drag`, with its equation and its source; imported when asked for."""

from __future__ import annotations

from importlib import import_module
from typing import NamedTuple

import numpy as np

from protocol.kinds import Friction
from protocol.messages import FrictionLaw


class Numbers(NamedTuple):
    """A law of friction in numbers; with a table the first two do not matter."""

    coefficient: float  # mu
    speed: float  # m/s, v0
    table: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None  # speeds (k,) m/s, normal forces (q,) N, forces (k, q) N


def numbers_of(friction: Friction, law: FrictionLaw) -> Numbers:
    """The numbers of a law."""
    numbers: Numbers = import_module(f"{__name__}.{friction.value}").numbers(law)
    return numbers
