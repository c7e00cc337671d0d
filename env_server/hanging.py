"""One cable as a step, or a round of it, left it: shape, boundary conditions, and what is near it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from protocol.effects import GOING
from protocol.kinds import Outcome
from protocol.messages import Contacts, Grasps, Shape, Start

from .boundary import Boundary
from .remesh import blended
from .self_boundary import Meeting
from .touch import Candidates

DEEP: Final = 0.5  # radii; only on the way to a shape beyond a strand are two strands as deep in each other
THROUGH: Final = "it snaps, and the shape that is found for it lies beyond another strand of its own, which it could only pass through"
Near = tuple[Candidates, Candidates, Meeting | None]  # bodies, links, and itself


@dataclass(frozen=True)
class Hanging:
    """One cable as the last step left it."""

    shape: Shape
    boundary: Boundary
    bodies: Candidates
    links: Candidates
    own: Meeting | None = None  # with itself; None for a cable that does not look


def start_of(was: Hanging | None) -> Start | None:
    """What the shape server is to start from; None for a cold start."""
    if was is None:
        return None
    shape = was.shape
    going = {one.name for one in shape.predicted if one.why == GOING}
    kept = tuple(name for name in shape.effects if name not in going)
    return Start(s=shape.s, frames=shape.frames, grasp_forces=shape.grasp_wrenches[:, :3], effects=kept)


def least_share(was: Hanging, now: Shape, least: float) -> float:
    """Share of the way to a shape that is taken in any case, though a body may be in between; but not through the cable itself."""
    if was.own is None:
        return least
    node = np.linalg.norm(now.nodes - was.shape.nodes, axis=1)
    return min(least, max(0.8 * was.own.free_share(np.maximum(node[1:], node[:-1])), 0.0))


def joined(cable: Hanging, body_count: int, reach: float) -> Candidates:
    """Places on bodies and links within reach as one list, numbered as the surfaces are."""
    near = cable.links.gap < reach
    if not near.any():
        return cable.bodies
    first, second = cable.bodies, cable.links
    names = [name for name in Candidates._fields if name not in ("body", "clearance")]
    columns = {name: np.concatenate([getattr(first, name), getattr(second, name)[near]]) for name in names}
    return Candidates(
        **columns,
        body=np.concatenate([first.body, second.body[near] + body_count]),
        clearance=np.minimum(first.clearance, second.clearance),
    )


def accepted(cables: tuple[Hanging, ...], contacts: Sequence[Contacts | None], poses: np.ndarray, time: float) -> tuple[Hanging, ...]:
    """The cables of a step that has settled, with what it leaves of their contacts."""
    return tuple(
        replace(cable, boundary=cable.boundary.accepted(contact, cable.shape, poses, time))
        for cable, contact in zip(cables, contacts, strict=True)
    )


def unsettled(cables: tuple[Hanging, ...], sentence: str) -> tuple[Hanging, ...]:
    """The cables of a step whose contacts never settled: no shape to go on from. Of strands deep in each other that is why."""
    return tuple(
        replace(cable, shape=_without(cable.shape, THROUGH if _is_in_itself(cable) else sentence))
        if cable.shape.outcome is Outcome.CONVERGED
        else cable
        for cable in cables
    )


def _without(shape: Shape, sentence: str) -> Shape:
    return msgspec.structs.replace(shape, outcome=Outcome.NOT_CONVERGED, sentence=sentence)


def _is_in_itself(cable: Hanging) -> bool:
    return cable.own is not None and cable.own.candidates.penetration > DEEP * cable.own.radius


def nowhere(shape: Shape, boundary: Boundary) -> Hanging:
    """A cable without a shape, whose outcome says why."""
    none = np.zeros(0)
    nothing = Candidates(**dict.fromkeys(Candidates._fields, none))
    return Hanging(shape, boundary, nothing, nothing)


def part_way(was: Shape, now: Shape, share: float, grasps: Grasps) -> Shape:
    """The shape a share of the way from one to another, its segments as long as they are.

    Not an equilibrium: a place from which to look for contacts on the way.
    """
    frames = blended(was.frames, now.frames, share)
    steps = np.diff(now.s)[:, None] * Rotation.from_quat(frames).apply([0.0, 0.0, 1.0])
    nodes = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    held = int(np.argmin(np.abs(now.s - grasps.s[0])))
    return msgspec.structs.replace(now, frames=frames, nodes=nodes + grasps.position[0] - nodes[held])
