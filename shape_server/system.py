"""From a problem to its system of equations: the sum of what the effects in use add."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache
from types import ModuleType
from typing import Any

import numpy as np

from protocol.kinds import FRICTION_CODES, Friction, Hold
from protocol.messages import PointLoads, Problem
from protocol.scene import Cable, Vector

from . import effects
from .mesh import Mesh
from .numpy_path import directors
from .rod import HELD, NO_RUB, TOUCH, Elastic, Held, Rod, Rub, State, from_columns
from .strands import Strands

SOFT = 0.2  # of a segment; with layers sqrt(EI / F) shorter than that the axis is as good as a polygon
KICK_MOST = 0.05  # rad, how far to go off a saddle


@dataclass(frozen=True)
class System:
    """The equations of one cable on one mesh, where their forces start, and which row belongs to what."""

    mesh: Mesh
    rod: Rod
    force: np.ndarray  # (h,) N, of every row of held points, to start from
    push: np.ndarray  # (m,) N, of every contact, to start from
    fraction: np.ndarray  # (m + 5k,) place of every contact along its segment, both and the normal of every self-contact, to start from
    drag: np.ndarray  # (f, 2) N, of every contact with friction, to start from
    base: int  # which grasp is the origin of positions, and has no rows
    row_grasp: np.ndarray  # (h,) int, which grasp each row holds; -1 for a bond
    bond_contact: np.ndarray  # (b,) int, which contact of the request each bond is
    couple: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) N m, given besides the loads

    @property
    def body_rows(self) -> int:
        """How many rows are contacts with bodies; those of the cable with itself come after them."""
        return len(self.push) - len(self.rod.strands.distance)

    def twist(self, path: ModuleType, frames: np.ndarray) -> float:
        """Twist [rad] of frames (n-1, 4) about the tangent, from the first node to the last."""
        return float(path.twist_of(frames, self.rod.clamp_of_node, self.rod.clamp_frames))

    def start(self, frames: np.ndarray) -> State:
        """The state with the given frames and the forces that the request starts from."""
        return State(
            frames=frames,
            force=self.force.copy(),
            holds=np.ones(len(self.bond_contact), dtype=bool),
            push=self.push.copy(),
            touches=self.push > 0.0,
            fraction=self.fraction.copy(),
            drag=self.drag.copy(),
            sticks=np.zeros(len(self.drag), dtype=bool),
            ease=np.zeros(len(self.drag)),
        )


def build(problem: Problem, gravity: Vector, used: tuple[str, ...], mesh: Mesh, touching: Any = None) -> System:
    """The system of equations of a problem on a mesh: the sum of what the effects in use add.

    `touching` is what `grouped` says of the problem, for a caller who builds it on several meshes.
    """
    grasps, cable = problem.grasps, problem.cable
    given = None if problem.loads is None else (problem.loads.s.tobytes(), problem.loads.force.tobytes())
    matter = _matter(cable, given, gravity, used, mesh.s.tobytes())
    framed = [k for k, hold in enumerate(grasps.hold) if hold is not Hold.HINGE]
    clamp_of_node = np.full(len(mesh.s), -1, dtype=np.int64)
    clamp_of_node[mesh.grasp_nodes[framed]] = np.arange(len(framed))
    base = next(k for k, hold in enumerate(grasps.hold) if hold is not Hold.GUIDE)
    held, force, row_grasp, bond_contact = _held(problem, used, mesh, base)
    touch, push, fraction = _touch(problem, used, mesh, touching)
    touch["is_straight"] = _are_straight(problem, matter, mesh, touch)
    rub, drag = _rub(problem, used, mesh, touch)
    touch, strands, push, fraction = _with_strands(problem, used, mesh, touch, push, fraction)
    shortest, kick = _spans(problem)
    rod = Rod(
        lengths=np.array(mesh.lengths),
        base=int(mesh.grasp_nodes[base]),
        origin=np.array(grasps.position[base]),
        clamp_of_node=clamp_of_node,
        clamp_frames=np.array(grasps.quaternion[framed]).reshape(-1, 4),
        elastic=matter.elastic,
        loads=matter.loads,
        give=matter.give,
        held=held,
        touch=touch,
        rub=rub,
        strands=strands,
        length=cable.length,
        stiffest=matter.stiffest,
        weight=matter.weight,
        force_scale=force_scale(matter.weight, matter.stiffest, cable.length),
        shortest=shortest,
        kick=kick,
    )
    return System(mesh, rod, force, push, fraction, drag, base, row_grasp, bond_contact)


@dataclass(frozen=True)
class Matter:
    """What a cable is on one mesh, however it is held."""

    elastic: Elastic
    loads: np.ndarray  # (n, 3) N
    give: np.ndarray  # (n-1,) m/N, or empty
    stiffest: float  # N m^2
    weight: float  # N


@lru_cache(maxsize=64)
def _matter(cable: Cable, given: tuple[bytes, bytes] | None, gravity: Vector, used: tuple[str, ...], s: bytes) -> Matter:
    """The sum of what the effects in use add, kept for the next request about the same cable on the same nodes.

    The result depends on the arguments alone, so that remembering it changes no answer; nothing writes to its arrays.
    """
    nodes = np.frombuffer(s)
    mesh = Mesh(nodes, np.diff(nodes), np.zeros(0, dtype=np.int64))
    point_loads = None if given is None else PointLoads(s=np.frombuffer(given[0]), force=np.frombuffer(given[1]).reshape(-1, 3))
    loads, law, bent = np.zeros((len(mesh.s), 3)), np.zeros((len(mesh.lengths), 3)), np.zeros((len(mesh.lengths), 3))
    give, smoothing, limit = np.zeros(0), np.zeros((0, 2)), np.zeros(0)
    for effect in (effects.load(name) for name in used):
        if hasattr(effect, "node_loads"):
            loads += effect.node_loads(cable, point_loads, gravity, mesh)
        if hasattr(effect, "stiffness"):
            law += effect.stiffness(cable, mesh)
        if hasattr(effect, "natural"):
            bent += effect.natural(cable, mesh)
        if hasattr(effect, "give"):
            give = effect.give(cable, mesh)
        if hasattr(effect, "smoothing"):
            smoothing = effect.smoothing(cable, mesh)
        if hasattr(effect, "limit"):
            limit = effect.limit(cable, mesh)
    elastic = elastic_of(law, bent, mesh.lengths, smoothing)._replace(limit=limit)
    return Matter(elastic, loads, give, stiffest(elastic, mesh), float(np.linalg.norm(loads.sum(axis=0))))


def stiffest(elastic: Elastic, mesh: Mesh) -> float:
    """Largest stiffness [N m^2] against an arch, whose curvature runs as a half wave along the cable."""
    law = elastic.law[:, :2].copy()
    if len(elastic.smoothing):
        law += elastic.smoothing * mesh.lengths[:, None] * (math.pi / mesh.s[-1]) ** 2
    return float(law.max())


def force_scale(weight: float, stiffest: float, length: float) -> float:
    """Typical force [N]: the weight, and what bends the cable into an arch."""
    return weight + 10.0 * stiffest / length**2


def elastic_of(law: np.ndarray, bent: np.ndarray, lengths: np.ndarray, smoothing: np.ndarray) -> Elastic:
    """Laws of segments, and of nodes: the halves of two segments in series, which have the same moment.

    With a micro-structure length l it is the curvature that they have the same, if they are shorter than l; where they are longer the two
    laws pass into each other over the length l on both sides, which takes the share l / a off the difference of the two compliances.
    """
    node_law, node_bent = np.zeros((len(lengths) + 1, 3)), np.zeros((len(lengths) + 1, 3))
    before, after = lengths[:-1, None], lengths[1:, None]
    node_law[1:-1] = (before + after) / (before / law[:-1] + after / law[1:])
    node_bent[1:-1] = (before * bent[:-1] + after * bent[1:]) / (before + after)
    if len(smoothing):
        mean = (before * law[:-1] + after * law[1:]) / (before + after)
        share = np.tanh(4.0 * micro_length(law, smoothing, lengths) / (before + after))
        node_law[1:-1, :2] = (1.0 / ((1.0 - share) / node_law[1:-1] + share / mean))[:, :2]
    return Elastic(law, bent, node_law, node_bent, smoothing, np.zeros(0))


def micro_length(law: np.ndarray, smoothing: np.ndarray, lengths: np.ndarray) -> float:
    """The micro-structure length l [m] of a rod that has one, from its ties."""
    return math.sqrt(smoothing[0, 0] * lengths[0] / law[0, 0])


def _held(problem: Problem, used: tuple[str, ...], mesh: Mesh, base: int) -> tuple[Held, np.ndarray, np.ndarray, np.ndarray]:
    """Rows of all grasps but the base, three each or two for a guide, and of the bonds; forces, grasps, contacts of bonds."""
    grasps = problem.grasps
    start = problem.start.grasp_forces if problem.start is not None else np.zeros((len(grasps.s), 3))
    axes = [np.eye(3) if hold is not Hold.GUIDE else _across(grasps.quaternion[k]) for k, hold in enumerate(grasps.hold)]
    chosen = [k for k in range(len(grasps.s)) if k != base]
    row_grasp = np.array([k for k in chosen for _ in axes[k]], dtype=np.int64)
    axis = np.array([row for k in chosen for row in axes[k]]).reshape(-1, 3)
    element, fraction = mesh.locate(grasps.s[row_grasp])
    point, force = grasps.position[row_grasp], start[row_grasp]
    bond, normal = np.full(len(row_grasp), -1, dtype=np.int64), np.zeros((0, 3))
    bond_contact, inclined = np.zeros(0, dtype=np.int64), 0
    if "bond" in used:
        assert problem.contacts is not None
        bond_contact = np.flatnonzero(problem.contacts.friction == FRICTION_CODES.index(Friction.BOND))
        bonds = effects.load("bond").rows(problem.contacts, bond_contact, mesh)
        each = np.repeat(np.arange(len(bond_contact)), 3)
        element, fraction = np.append(element, bonds.element[each]), np.append(fraction, bonds.fraction[each])
        axis = np.vstack([axis, np.tile(np.eye(3), (len(bond_contact), 1))])
        point, force = np.vstack([point, bonds.anchor[each]]), np.vstack([force, bonds.force[each]])
        bond, normal = np.append(bond, each), np.array(bonds.normal)
        row_grasp = np.append(row_grasp, np.full(len(each), -1))
    if "inclination" in used:
        assert problem.contacts is not None
        chosen = effects.load("inclination").bonds(problem.contacts, bond_contact)
        element, fraction = np.append(element, bonds.element[chosen]), np.append(fraction, bonds.fraction[chosen])
        axis, bond = np.vstack([axis, normal[chosen]]), np.append(bond, chosen)
        none = np.zeros((len(chosen), 3))
        point, force, row_grasp = np.vstack([point, none]), np.vstack([force, none]), np.append(row_grasp, np.full(len(chosen), -1))
        inclined = len(chosen)
    goal = np.einsum("ij,ij->i", axis, point)
    rows = from_columns(HELD, {"element": element, "fraction": fraction, "axis": axis, "goal": goal, "bond": bond})
    return Held(rows, normal, inclined), np.einsum("ij,ij->i", axis, force), row_grasp, bond_contact


def _across(quaternion: np.ndarray) -> np.ndarray:
    """The two directions square to the tangent of a frame, (2, 3)."""
    rows: np.ndarray = directors(quaternion[None, :])[0, :2]
    return rows


def grouped(problem: Problem, used: tuple[str, ...], reach: int = 1) -> Any:
    """The one-sided contacts of a problem by what they touch, the same for every mesh; None without any; `reach` as in `Grouped`."""
    if "contact" not in used:
        return None
    assert problem.contacts is not None
    chosen = np.flatnonzero(problem.contacts.friction != FRICTION_CODES.index(Friction.BOND))
    return effects.load("contact").grouped(problem.contacts, chosen, reach)


def _touch(problem: Problem, used: tuple[str, ...], mesh: Mesh, touching: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One-sided rows, their forces and places; none without contacts."""
    groups = grouped(problem, used) if touching is None else touching
    if groups is not None:
        rows: tuple[np.ndarray, np.ndarray, np.ndarray] = effects.load("contact").rows(problem.contacts, groups, mesh)
        return rows
    return np.zeros(0, dtype=TOUCH), np.zeros(0), np.zeros(0)


def _are_straight(problem: Problem, matter: Matter, mesh: Mesh, touch: np.ndarray) -> np.ndarray:
    """For which rows (m,) the cable is too soft to round its nodes.

    There the bulge of `contact_geometry` lets neighbouring segments rock to and fro at no cost, and no shape is stable.
    """
    start = problem.start
    pull = max(matter.weight, 0.0 if start is None else float(np.linalg.norm(start.grasp_forces, axis=1).max(initial=0.0)))
    length = mesh.lengths[touch["element"]]
    is_soft = matter.elastic.law[touch["element"], :2].min(axis=1) < pull * (SOFT * length) ** 2
    return np.asarray(is_soft)


def _rub(problem: Problem, used: tuple[str, ...], mesh: Mesh, touch: np.ndarray) -> tuple[Rub, np.ndarray]:
    """Rows of friction and their forces, which rows of `touch` (m,) they belong to put down there; none without friction."""
    if "friction" not in used:
        return NO_RUB, np.zeros((0, 2))
    assert problem.contacts is not None
    friction = effects.load("friction")
    rub, drag = friction.rows(problem.contacts, friction.laws(problem.contacts), mesh)
    row_of_contact = np.full(len(problem.contacts.s), -1, dtype=np.int64)
    row_of_contact[rub.rows["contact"]] = np.arange(len(rub.rows))
    touch["rub"] = row_of_contact[touch["contact"]]
    return rub, drag


def _with_strands(
    problem: Problem, used: tuple[str, ...], mesh: Mesh, touch: np.ndarray, push: np.ndarray, fraction: np.ndarray
) -> tuple[np.ndarray, Strands, np.ndarray, np.ndarray]:
    """Contacts with bodies, those of the cable with itself after them, and the forces and places of both."""
    if "self_contact" not in used:
        return touch, no_strands(), push, fraction
    assert problem.self_contacts is not None
    strands, own_push, places = effects.load("self_contact").rows(problem.self_contacts, len(push), mesh)
    more = len(own_push)
    own = np.zeros(more, dtype=TOUCH)
    own["contact"], own["rub"] = -1 - np.arange(more), -1
    return np.concatenate([touch, own]), strands, np.append(push, own_push), np.concatenate([fraction, np.zeros(more), places])


def no_strands() -> Strands:
    """A cable that does not touch itself."""
    return Strands(0, np.zeros((0, 2)), np.zeros(0), np.zeros(0))


def _spans(problem: Problem) -> tuple[float, float]:
    """Shortest piece between held points [m], at least a fifth of the cable; and how far to go off a saddle [rad].

    Less for a nearly taut cable, which a large kick would take past the arch that it belongs to.
    """
    grasps, length = problem.grasps, problem.cable.length
    if len(grasps.s) == 1:
        return length, KICK_MOST
    spans, chords = grasps.s[1:] - grasps.s[:-1], grasps.position[1:] - grasps.position[:-1]
    slack = 1.0 - float((np.sqrt((chords * chords).sum(axis=1)) / spans).max())
    kick = min(KICK_MOST, 0.5 * math.sqrt(max(slack, 0.0)) + 1e-4)
    return max(float(spans.min()), 0.2 * length), kick
