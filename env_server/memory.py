"""What a run must remember to go on after its program was killed: the checkpoint of a step, and a loop that goes on from one.

Everything else is made anew from the scene: bodies, robot and path are planned before the first step and stay as they are, and the
shape server keeps nothing. A step depends on no more than what is here, so that a run goes on bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

from .audit import Audits
from .looking import Reach
from .loop import Loop
from .stepped import Stepped

REMEMBERED: Final = {
    "_now": "now",
    "_collisions": "collisions",
    "_reach": "reach",
    "_audits": "audits",
}
FORGOTTEN: Final = {"_stage", "_asker", "_session", "_meter", "_round", "_auditor"}  # given anew, or begun anew with every step


@dataclass(frozen=True)
class Checkpoint:
    """A run after one of its steps."""

    session: str
    step: int
    late: float  # s, by which relaxations have held up the path
    size: int  # bytes of the journal up to the frame of this step
    now: Stepped
    collisions: tuple[tuple[str, str], ...]
    reach: Reach
    audits: Audits


def checkpoint(loop: Loop, session: str, step: int, late: float, size: int) -> Checkpoint:
    """What a loop has to remember."""
    remembered: dict[str, Any] = {field: getattr(loop, name) for name, field in REMEMBERED.items()}
    return Checkpoint(session=session, step=step, late=late, size=size, **remembered)


def resume(loop: Loop, kept: Checkpoint) -> None:
    """Let a new loop go on after the step of a checkpoint."""
    for name, field in REMEMBERED.items():
        setattr(loop, name, getattr(kept, field))
