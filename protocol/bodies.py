"""What a scene may say about bodies, beyond what the types say: as sentences, empty where all is well."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .scene import Target


def target_mistake(target: Target) -> str:
    """What is wrong with a target of a move, besides names; empty if nothing is."""
    if (target.gripper is None) == (target.body is None):
        return "needs either 'gripper' or 'body', one of the two"
    if target.gripper is not None and target.turn is not None:
        return "'turn' is for a body; turn a gripper by 'tangent' and 'approach'"
    for name in ("clip", "tangent", "approach"):
        if target.body is not None and getattr(target, name) is not None:
            return f"'{name}' is for a gripper; move a body by 'by' or 'to', and turn it by 'turn'"
    return ""
