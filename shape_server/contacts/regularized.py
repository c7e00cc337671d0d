"""Regularized friction (F_R): mu N v / sqrt(v^2 + v0^2) against the sliding velocity; nothing at rest, so a load makes it creep.

The smaller v0, the nearer to Coulomb's friction; under a force t below mu N a contact creeps with v0 t / sqrt((mu N)^2 - t^2).

Source: the paper's sec. 3.1, after Bayada, Chambat and Lakhal 1998, Math. Comput. Model. 28, 67-85.
"""

from __future__ import annotations

from protocol.errors import MessageError
from protocol.messages import FrictionLaw

from . import Numbers


def numbers(law: FrictionLaw) -> Numbers:
    """F(v, N) = mu N v / sqrt(v^2 + v0^2).

    Raises:
        MessageError: If v0 is missing.
    """
    if law.speed <= 0.0:
        raise MessageError("speed: regularized friction needs v0, a speed above 0 m/s; without it ask for 'signum'", key="speed")
    return Numbers(law.coefficient, law.speed)
