"""Hard cases as other programs answer them: what a case asks of the solver is asked of a peer too, and judged by the same reference.

A peer gives places only. So a case is first run as ever, and where its references and invariants hold, the shape that they found right is
what the peer's nodes are compared with. They may be off by a hundredth of the length, which is far more than most cases allow
the solver: a peer's mesh is its own affair. Where the solver refuses since no cable is that long, the peer must not give a shape that is
longer than the cable by a thousandth.

Every problem is handed on in units in which the cable has length 1 m and weight 1 N/m, with gravity along -z, because the settings of the
peers were sought there; a cable without bending has EI = 1e-6 w L^3, but in MoorPy. Rods without weight are not handed on: their
shapes come in pairs and in rings. A peer that ends in another equilibrium than ours is off like any other.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial
from types import ModuleType
from typing import Any, Final

import numpy as np
from scipy.spatial.transform import Rotation

from protocol.hard_case import Case, Check, Declined, Ending, Unsound
from protocol.kinds import Hold, Outcome
from protocol.messages import Problem, Shape
from protocol.scene import Vector

from ..accuracy.peers import installed, peer_moorpy, posed
from ..accuracy.peers.motions import LEVEL, Hanging, Rod
from .answers import Asked
from .posing import place

PEERS: Final = {peer.DISTRIBUTION.lower(): peer for peer in (*installed.FOLLOWING, peer_moorpy)}
WITHIN: Final = 0.01  # of the length
LONGER: Final = 1e-3  # of the length, by which a cable may be stretched to where it does not reach
LIMP: Final = 1e-6  # EI over w L^3, of a cable without bending
FAINTEST: Final = 1e-4  # w L^3 over EI, up to which a rod is as good as weightless
LIMPEST: Final = 1e-5  # the same, up to which a rod is a problem for a program without bending
MOST: Final = 3  # shapes that a case may ask for
OVER: Final = Rotation.from_rotvec([np.pi, 0.0, 0.0])  # of a frame, when its cable is named from the other end
MIRROR: Final = np.array([1.0, -1.0, 1.0])  # in the plane x-z


def names() -> tuple[str, ...]:
    """The peers that are installed."""
    return tuple(name for name, peer in PEERS.items() if installed.is_installed(peer))


def warm_up(peer: ModuleType) -> None:
    """Import a peer, and let it compile what it compiles, so that no case is timed with that."""
    if peer is not peer_moorpy:
        rod, level = Rod(bending=1e-2, twist=8e-3), np.array([LEVEL.as_quat()] * 2)
        posed.nodes(peer, posed.Posed(rod, np.array([[0.0, 0.0, 0.0], [0.6, 0.0, 0.0]]), level, is_planar=True))


def cases_of(cases: Iterable[Case]) -> tuple[Case, ...]:
    """The same cases, measured on a peer."""
    return tuple(replace(case, measure=partial(_measured, case)) for case in cases)


def _measured(case: Case, answering: tuple[ModuleType, ModuleType]) -> Iterable[Check]:
    """On the peer and the path that are given."""
    peer, path = answering
    asked = Asked(path, partial(_why_not, peer))
    verdict = case.run(asked)
    if asked.refusal:
        raise Declined(Outcome.UNSUPPORTED, asked.refusal)
    if verdict.ending is not Ending.RIGHT and not (asked.answers and asked.answers[-1][2].outcome is Outcome.UNREACHABLE):
        raise Declined(Outcome.UNSUPPORTED, f"nothing to compare {peer.NAME} with: {verdict.sentence}")
    for problem, gravity, shape in asked.answers:
        yield _check(peer, Units.of(problem, gravity), shape)


def _why_not(peer: ModuleType, problem: Problem, gravity: Vector, before: int) -> str:
    """Why a problem cannot be handed on to a peer; empty if it can be."""
    held, cable = problem.grasps, problem.cable
    if before == MOST:
        return f"a chain of more than {MOST} shapes is not handed on"
    if problem.contacts is not None or problem.self_contacts is not None or problem.loads is not None:
        return f"{peer.NAME} is not set up for contacts and loads"
    if problem.start is not None or any(problem.turns) or problem.branch:
        return f"{peer.NAME} is led to the poses of the clamps, and to no branch that is chosen otherwise"
    if len(held.s) != 2 or held.s[0] != 0.0 or held.s[1] != cable.length:
        return f"{peer.NAME} is set up for a cable that is held at its two ends"
    if _weight(problem, gravity) <= FAINTEST * (cable.bending or 0.0):
        return f"{peer.NAME} is led to one shape, and without weight there are others that are as right"
    odd = (cable.stretch, cable.bending_2, cable.natural_curvature, cable.micro_length, cable.bend_radius)
    if cable.sections or cable.masses or any(value is not None for value in odd):
        return f"{peer.NAME} is set up for a uniform, inextensible, naturally straight cable"
    units = Units.of(problem, gravity)
    if peer is peer_moorpy:
        return "" if units.posed.rod.bending <= LIMPEST else f"{peer.NAME} knows no bending"
    if cable.bending is not None and any(hold is not Hold.CLAMP for hold in held.hold):
        return f"{peer.NAME} is set up for clamps"
    return ""


@dataclass(frozen=True)
class Units:
    """A problem where its first clamp is the origin, its length one, and gravity along -z with a weight of one."""

    posed: posed.Posed
    turn: Rotation  # to there
    origin: np.ndarray  # (3,) m, that of the clamp at `posed`'s origin
    length: float  # m
    is_reversed: bool
    is_flat: bool  # the mirror image in the plane x-z is as right

    @classmethod
    def of(cls, problem: Problem, gravity: Vector) -> Units:
        """From a problem with two grasps."""
        cable, held = problem.cable, problem.grasps
        down = np.asarray(gravity)
        is_reversed = bool((held.position[1] - held.position[0]) @ down > 0.0)
        order = [1, 0] if is_reversed else [0, 1]
        frames = Rotation.from_quat(held.quaternion[order])
        frames = frames * OVER if is_reversed else frames
        chord, tangent = np.diff(held.position[order], axis=0)[0], frames.apply([0.0, 0.0, 1.0])
        turn = _upright(down, (chord, *tangent))
        position = turn.apply(held.position[order] - held.position[order[0]]) / cable.length
        frames = turn * frames
        bending = LIMP if cable.bending is None else cable.bending / _weight(problem, gravity)
        twist = bending if cable.bending is None or cable.twist is None else bending * cable.twist / cable.bending
        axes = frames.as_matrix()
        is_flat = bool(max(np.abs(position[:, 1]).max(), np.abs(axes[:, 1, 2]).max()) < 1e-9)
        is_planar = cable.bending is None or (is_flat and bool(np.abs(axes[0, :, 1] - axes[1, :, 1]).max() < 1e-9))
        rod = Rod(bending=float(bending), twist=float(twist))
        asked = posed.Posed(rod, position, frames.as_quat(), is_planar)
        return cls(asked, turn, held.position[order[0]].copy(), cable.length, is_reversed, is_flat)

    def points(self, shape: Shape, s: np.ndarray) -> np.ndarray:
        """(n, 3) Where a shape of the problem is in these units, at arc lengths s (n,) in them."""
        there = self.length * (1.0 - s if self.is_reversed else s)
        return np.asarray(self.turn.apply(place(shape, there) - self.origin) / self.length)


def _weight(problem: Problem, gravity: Vector) -> float:
    """Weight times length squared, w L^3 [N m^2], which tells with EI how much a rod bends under its weight."""
    return problem.cable.mass_per_length * float(np.linalg.norm(gravity)) * problem.cable.length**3


def _upright(down: np.ndarray, ways: Iterable[np.ndarray]) -> Rotation:
    """The turn that takes `down` to -z, and the first of some vectors that is not along it to y = 0, x > 0."""
    z = -down / np.linalg.norm(down)
    for way in (*ways, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])):
        x = way - way @ z * z
        if np.linalg.norm(x) > 1e-9 * np.linalg.norm(way) > 0.0:
            break
    x /= np.linalg.norm(x)
    return Rotation.from_matrix(np.array([x, np.cross(z, x), z]))


def _check(peer: ModuleType, units: Units, shape: Shape) -> Check:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            s, nodes = _hung(peer, units.posed) if peer is peer_moorpy else posed.nodes(peer, units.posed)
    except Exception as error:  # whatever a foreign program raises is its way to say that it gives no shape
        raise Declined(Outcome.NOT_CONVERGED, f"{peer.NAME} gives no shape: {type(error).__name__}: {error}") from error
    if not np.isfinite(nodes).all():
        if peer in posed.IN_TIME:
            raise Unsound(f"{peer.NAME}: not a number")
        raise Declined(Outcome.NOT_CONVERGED, f"{peer.NAME} says that it finds no shape")
    if shape.outcome is not Outcome.CONVERGED:
        longer = float(np.linalg.norm(np.diff(nodes, axis=0), axis=1).sum() / np.ptp(s)) - 1.0
        return Check("a cable that is stretched to a shape that it cannot have", longer, LONGER, "of the length")
    exact = units.points(shape, s)
    off = [float(np.linalg.norm(nodes - other, axis=1).max()) for other in (exact, exact * MIRROR)]
    return Check("distance from the right shape", min(off) if units.is_flat else off[0], WITHIN, "of the length")


def _hung(peer: Any, asked: posed.Posed) -> tuple[np.ndarray, np.ndarray]:
    hanging = Hanging(1.0, float(asked.position[1, 0]), 1.0)
    return hanging.s(), peer.hang(hanging, float(np.hypot(*asked.position[1, :2])), float(asked.position[1, 2]))
