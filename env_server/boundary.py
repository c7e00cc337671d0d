"""Contacts of one cable as boundary conditions: which are kept, added and dropped (the paper's Fig. 9, sections 3.1 to 3.3).

A place within reach of a body is handed to the shape server as a one-sided row; the server decides which rows push. On a
body with friction `none` (F_0) that is all. On a body with friction `bond` (F_inf) a place that pushes becomes a bond once
the step has settled: from then on the touched point of the cable stays at the touched point of the body, until it would
have to pull (the server drops it), or until the cable between it and the next fixed point is taut: then material is drawn
through so that this part stays straight (the distance criterion, 3.2). Which contacts exist is a matter of the path taken
(the motion criterion, 3.3); nothing else is remembered. On a body with friction of another kind a row also says where it was held
(`anchors`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from protocol.kinds import FRICTION_CODES, Friction
from protocol.messages import Contacts, Grasps, Shape

from . import anchors
from .bond import Bond as Bond
from .bond import slid
from .piece_hits import FACE
from .polyline import points_at
from .poses import inside, outside, turn_inside, turn_outside
from .touch import Candidates

DEPTH_OK: Final = 2e-6  # m; deeper, and the boundary conditions are evaluated again
GAP_OK: Final = 1e-5  # m; a contact that pushes must be no further than this from its body, besides the bulge of the axis
SAME_NORMAL: Final = 0.98  # cosine between two normals of one contact
TAUT: Final = 1e-5  # of the length; a part with less slack than this is taut
SAME_PLACE: Final = 1e-3  # of a segment; a row this near to a bond says the same
BEHIND: Final = 4.0  # segments beside a bond in which the side of a thin body says nothing
BENT: Final = 2.5  # radii beside a sharp bend about a point within which the cable is nearer to it than its radius
APART: Final = 0.5  # of a segment; beside a bond nothing else needs to be bonded
FREE, BONDED = FRICTION_CODES.index(Friction.NONE), FRICTION_CODES.index(Friction.BOND)


@dataclass(frozen=True)
class Pushes:
    """Contacts that carried a force in the last shape, one row each."""

    surface: np.ndarray  # (p,) int
    s: np.ndarray  # (p,) m
    normal: np.ndarray  # (p, 3)
    force: np.ndarray  # (p, 3) N
    point: np.ndarray  # (p, 3) m, on the body
    is_bond: np.ndarray  # (p,) bool
    bulge: float  # m, how far the curved axis may stand off from the straight segments, kappa h^2 / 8


NO_PUSHES: Final = Pushes(
    surface=np.zeros(0, dtype=np.int64),
    s=np.zeros(0),
    normal=np.zeros((0, 3)),
    force=np.zeros((0, 3)),
    point=np.zeros((0, 3)),
    is_bond=np.zeros(0, dtype=bool),
    bulge=0.0,
)


@dataclass(frozen=True)
class Boundary:
    """The contacts of one cable; a new value after every change, so that a step that fails is forgotten."""

    radius: float  # m
    length: float  # m
    bonding: np.ndarray  # (surfaces,) bool, whose friction is `bond`
    inclined: np.ndarray | None = None  # (surfaces,) bool, whose inclination is `fixed`; None if that of none is
    is_limp: bool = False  # without bending; bonded where it first touches (`first_touch`)
    bonds: tuple[Bond, ...] = ()
    pushes: Pushes = NO_PUSHES
    laws: anchors.Laws | None = None  # of friction; None where no body rubs
    anchors: anchors.Anchors | None = None  # of the last step that settled

    def contacts(self, candidates: Candidates, s: np.ndarray, poses: np.ndarray, time: float) -> Contacts | None:
        """The rows to ask the shape server about; None if nothing is within reach.

        Args:
            candidates: Places within reach.
            s: (n,) [m] Arc length of the nodes that they refer to.
            poses: (surfaces, 7) Poses of all surfaces.
            time: [s] Of these poses.
        """
        place, spacing = at_place(candidates, s), float((s[1:] - s[:-1]).max())
        free = ~self.bonding[candidates.body] if self.is_limp else np.ones(len(place), dtype=bool)
        for bond in self.bonds:
            free &= (candidates.body != bond.surface) | (np.abs(place - bond.s) > SAME_PLACE * spacing)
        count, bonds = int(free.sum()), self.bonds
        if count + len(bonds) == 0:
            return None
        bond_rows = [(outside(poses[b.surface], b.point), turn_outside(poses[b.surface], b.normal)) for b in bonds]
        body = np.concatenate([candidates.body[free], np.array([b.surface for b in bonds], dtype=np.int64)])
        normal = np.vstack([candidates.normal[free], *(row for _, row in bond_rows)])
        where = np.concatenate([place[free], np.array([b.s for b in bonds])])
        force = np.zeros((count + len(bonds), 3))
        self._share_pushes(body[:count], where[:count], normal[:count], force[:count], spacing)
        for row, bond in enumerate(bonds):
            force[count + row] = bond.force
        contacts = Contacts(
            s=where,
            body=body,
            feature=np.concatenate([candidates.feature[free], np.zeros(len(bonds), dtype=np.int64)]),
            point=np.vstack([candidates.point[free], *(row for row, _ in bond_rows)]),
            normal=normal,
            direction=np.vstack([candidates.direction[free], np.zeros((len(bonds), 3))]),
            extent=np.vstack([candidates.extent[free], np.zeros((len(bonds), 2))]),
            distance=self.radius + np.concatenate([candidates.thickness[free], np.zeros(len(bonds))]),
            friction=np.concatenate([np.full(count, FREE), np.full(len(bonds), BONDED)]),
            force=force,
            inclination=None if self.inclined is None else self.inclined[body].astype(np.int64),
        )
        return contacts if self.laws is None else anchors.rubbing(self.laws, self.anchors, contacts, poses, time, spacing)

    def after(self, contacts: Contacts | None, shape: Shape, poses: np.ndarray) -> Boundary:
        """What the shape server's answer leaves of the contacts it was asked about."""
        if contacts is None:
            return replace(self, bonds=(), pushes=NO_PUSHES)
        size = np.einsum("ij,ij->i", shape.contact_forces, shape.contact_forces)
        on = np.flatnonzero(size > 0.0)
        first_bond = len(contacts.s) - len(self.bonds)
        bonds = tuple(
            slid(bond, shape, first_bond + row, poses[bond.surface])
            if self.is_limp
            else replace(bond, force=shape.contact_forces[first_bond + row])
            for row, bond in enumerate(self.bonds)
            if size[first_bond + row] > 0.0
        )
        force = shape.contact_forces[on]
        is_bond = on >= first_bond
        normal = np.where(is_bond[:, None], contacts.normal[on], force / np.sqrt(size[on])[:, None])
        where = shape.contact_s[on]
        if contacts.rubbing is not None:
            rubs = np.isin(on, contacts.rubbing.contact)
            normal[rubs] = anchors.surface_normals(contacts, on[rubs], points_at(shape, where[rubs]))
        bulge = float(shape.curvature.max()) * float((shape.s[1:] - shape.s[:-1]).max()) ** 2 / 8
        if self.is_limp and len(on):  # both tangents at its bend pass a body at the radius, from which the pieces then hang away
            beside = BENT * self.radius
            near = (np.abs(shape.s[:, None] - where) < beside + np.diff(shape.s).max()).any(axis=1)
            bulge = max(bulge, float(shape.curvature[near].max()) * beside**2 / 2)
        pushes = Pushes(contacts.body[on], where, normal, force, points_at(shape, where) - self.radius * normal, is_bond, bulge)
        return replace(self, bonds=bonds, pushes=pushes)

    def is_settled(self, candidates: Candidates, s: np.ndarray) -> bool:
        """Whether nothing is penetrated, and every push comes from a body that is really there."""
        if candidates.is_crossing.any():
            return False
        place, spacing = at_place(candidates, s), np.diff(s)
        deepest = -np.inf if self.is_limp else -self.radius
        if (candidates.gap < np.where(self._is_kink(candidates, s), deepest, -DEPTH_OK)).any():
            return False
        pushes = self.pushes
        near = candidates.gap < GAP_OK + pushes.bulge
        same = 0.0 if self.is_limp else SAME_NORMAL  # where it bends sharply, each piece has a normal of its own
        for row in np.flatnonzero(~pushes.is_bond).tolist():
            there = near & (candidates.body == pushes.surface[row]) & (np.abs(place - pushes.s[row]) < 1.01 * spacing.max())
            if not (candidates.normal[there] @ pushes.normal[row] > same).any():
                return False
        return True

    def missed(self, candidates: Candidates, s: np.ndarray, depth: float = DEPTH_OK) -> np.ndarray:
        """Which places (m,) on bonding bodies are deeper than `depth` [m] within them, and not beside a bond."""
        inside_body: np.ndarray = self.bonding[candidates.body] & (candidates.gap < -depth) & ~self._is_kink(candidates, s)
        return inside_body

    def _is_kink(self, candidates: Candidates, s: np.ndarray) -> np.ndarray:
        """Which places (m,) are beside a bond to a point or an edge: without bending the cable passes it within its own radius there.

        A place behind a point or a line, as seen from where that was touched, is beside a sharp bend at several segments from it too.
        """
        place, spacing, out = at_place(candidates, s), float((s[1:] - s[:-1]).max()), np.zeros(len(candidates.gap), dtype=bool)
        near = np.where(candidates.gap < -self.radius, BEHIND * spacing, max(spacing, BENT * self.radius)) if self.is_limp else spacing
        for bond in self.bonds:
            out |= (candidates.body == bond.surface) & (np.abs(place - bond.s) < near + bond.drawn)
        if self.is_limp:  # it bends as sharply where it slides, but over what is wider than its segments
            for surface, s_bend in zip(self.pushes.surface.tolist(), self.pushes.s.tolist(), strict=True):
                out |= (candidates.body == surface) & (np.abs(place - s_bend) < near) & (candidates.thickness <= spacing)
        out &= candidates.feature != FACE
        return out

    def accepted(self, contacts: Contacts | None, shape: Shape, poses: np.ndarray, time: float) -> Boundary:
        """With what a step leaves that has settled: bonds, and where the cable is held."""
        return self.anchored(contacts, shape, poses, time).bonded(poses, float((shape.s[1:] - shape.s[:-1]).max()))

    def anchored(self, contacts: Contacts | None, shape: Shape, poses: np.ndarray, time: float) -> Boundary:
        """With the cable held where it now rubs, and nothing drawn through, once a step has settled."""
        rested = replace(self, bonds=tuple(replace(bond, drawn=0.0) for bond in self.bonds)) if self.bonds else self
        return rested if self.laws is None else replace(rested, anchors=anchors.anchored(contacts, shape, poses, time))

    def bonded(self, poses: np.ndarray, spacing: float) -> Boundary:
        """With every push on a bonding body turned into a bond, where none is near; once a step has settled.

        Args:
            poses: (surfaces, 7) Poses of all surfaces.
            spacing: [m] Length of a segment.
        """
        pushes = self.pushes
        taken = np.array([bond.s for bond in self.bonds])
        new = tuple(
            Bond(
                surface=surface,
                s=float(pushes.s[row]),
                point=inside(poses[surface], pushes.point[row]),
                normal=turn_inside(poses[surface], pushes.normal[row]),
                force=pushes.force[row],
            )
            for row, surface in enumerate(pushes.surface.tolist())
            if self.bonding[surface] and not pushes.is_bond[row] and not (np.abs(taken - pushes.s[row]) < APART * spacing).any()
        )
        return replace(self, bonds=self.bonds + new) if new else self

    def drawn_through(self, grasps: Grasps, poses: np.ndarray) -> Boundary:
        """With material drawn through the bonds where the cable would be stretched (the distance criterion, 3.2)."""
        if not self.bonds:
            return self
        bonds = sorted(self.bonds, key=lambda bond: bond.s)
        points = [outside(poses[b.surface], b.point + self.radius * b.normal) for b in bonds]
        fixed = sorted(
            [(float(at), point, -1) for at, point in zip(grasps.s, grasps.position, strict=True)]
            + [(bond.s, point, index) for index, (bond, point) in enumerate(zip(bonds, points, strict=True))],
            key=lambda item: item[0],
        )
        at = np.array([item[0] for item in fixed])
        needed = np.array([np.linalg.norm(b[1] - a[1]) for a, b in pairwise(fixed)]) * (1 + TAUT)
        movable = np.array([item[2] >= 0 for item in fixed])
        for _ in range(2 * len(fixed)):
            short = needed - np.diff(at)
            worst = int(np.argmax(short)) if len(short) else 0
            if not len(short) or short[worst] <= 0.0:
                break
            # The bond with more slack on its other side gives; a part between two grasps cannot.
            slack = np.concatenate([[-np.inf], -short, [-np.inf]])
            left, right = slack[worst] if movable[worst] else -np.inf, slack[worst + 2] if movable[worst + 1] else -np.inf
            if max(left, right) == -np.inf:
                break
            if right >= left:
                at[worst + 1] += short[worst]
            else:
                at[worst] -= short[worst]
        moved = [
            replace(bonds[item[2]], s=float(place), drawn=bonds[item[2]].drawn + abs(float(place) - item[0]))
            for item, place in zip(fixed, at, strict=True)
            if item[2] >= 0
        ]
        return replace(self, bonds=tuple(bond for bond in moved if 0.0 < bond.s < self.length))

    def _share_pushes(self, body: np.ndarray, place: np.ndarray, normal: np.ndarray, force: np.ndarray, spacing: float) -> None:
        """Give every push of the last shape to the nearest row of its kind, as a force to start from."""
        pushes = self.pushes
        if not len(body):
            return
        for row in np.flatnonzero(~pushes.is_bond).tolist():
            away = np.abs(place - pushes.s[row])
            away = np.where((body == pushes.surface[row]) & (normal @ pushes.normal[row] > (0.0 if self.is_limp else 0.8)), away, np.inf)
            nearest = int(np.argmin(away))
            if away[nearest] < 2 * spacing:
                rubs = self.laws is not None and self.laws.code[body[nearest]] > 0
                force[nearest] += pushes.force[row] if rubs else np.linalg.norm(pushes.force[row]) * normal[nearest]


def at_place(candidates: Candidates, s: np.ndarray) -> np.ndarray:
    """Arc lengths (m,) [m] of places, from those of the nodes (n,) [m]."""
    before = s[candidates.segment]
    place: np.ndarray = before + candidates.fraction * (s[candidates.segment + 1] - before)
    return place
