"""What a cable without bending touches: which bonds hold, which contacts push, and the shape between them.

A bond is a point that holds the cable. What holds it along the body is friction without limit, but friction needs a push: where a
bond would pull, the cable slides through it, the way the larger tension draws it, to the first place where it no longer would; where
there is none before both tensions are the same, it is dropped, the hardest pulling first. A point or an edge without friction is slid
over (`draped`); it is taken up where the cable would pass through it, and let go where it would pull. Contacts about one point or edge
are one contact, whose push the two rows beside the bend share along their own normals, as each piece of the cable is pushed where it
is tangent to the feature. Where a sharp bend about something thick would be off by more than the tolerance the cable lies round it in an
arc (`winding`). From a start shape that is left to `limp`, for contacts of arcs do not settle from step to step.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import ModuleType
from typing import Final

import numpy as np

from protocol.kinds import FRICTION_CODES, Friction, Outcome
from protocol.messages import Contacts, Problem

from .clock import Clock
from .draped import PASSED, Draped, drape, gap, in_order
from .effects.contact import grouped
from .hanging import SEGMENTS, Hanging, nothing, on_finer, pieces_of
from .mesh import Mesh, even, from_nodes, stops, with_nodes_at
from .rounding import Refusal
from .slides import Hold, Slide, slides_of

WOUND: Final = (
    "the cable winds around what it touches, which from a start shape and beside a bond a cable without bending does not do; "
    "give it 'bending' and 'twist', or leave out the start"
)
CHANGES_MAX: Final = 60  # of what holds the cable
SLIDE_LEAST: Final = 1e-7  # of the length, by which a bond that pulls slides at first; then twice as far
SLIDE_HALVINGS: Final = 30  # of the last of these steps
NEAR: Final = 1.5  # distances from a bond within which a point or an edge is what it is bonded to


@dataclass
class _Held:
    """What holds a cable besides its grippers, while that is being found out."""

    bonds: dict[int, float]  # m, where each row holds the cable
    sliding: list[Slide]
    open: list[Slide]
    let_go: set[int] = field(default_factory=set)  # first rows of contacts that would have pulled


def solve_touching(problem: Problem, load: np.ndarray, tolerance: float, clock: Clock | None, path: ModuleType) -> Hanging:
    """The catenaries of a cable without bending that touches, or may touch.

    What it touches is found on a mesh as fine as the tolerance asks; with a clock the shape is then given on the finest that fits.
    A place on a face without friction is answered as unsupported if the cable would pass through it.
    """
    contacts = problem.contacts
    assert contacts is not None
    is_bond = contacts.friction == FRICTION_CODES.index(Friction.BOND)
    if not (is_bond | (contacts.friction == FRICTION_CODES.index(Friction.NONE))).all():
        sentence = "a cable without bending is bonded to what it touches or slides without friction; give it 'bending' and 'twist' to rub"
        return nothing(problem, Outcome.UNSUPPORTED, sentence)
    held = _Held({row: float(contacts.s[row]) for row in _separate(problem, is_bond)}, [], [])
    groups = grouped(contacts, np.flatnonzero(~is_bond), 1)
    found = [slides_of(contacts, groups.chosen[own].tolist(), problem.start) for own in groups.features]
    for slide in found:
        (held.sliding if (contacts.force[slide.rows] != 0.0).any() else held.open).append(slide)
    faces = groups.chosen[groups.faces]
    for _ in range(CHANGES_MAX):
        if clock is not None and clock.rest <= 0.0:
            within = f"the budget of {1e3 * clock.budget:.3g} ms"
            sentence = f"{within} does not reach for a first shape: its contacts would not have settled in time"
            return nothing(problem, Outcome.NOT_CONVERGED, sentence)
        draped = _drape(problem, load, held)
        if isinstance(draped, Refusal) and draped.outcome is not Outcome.UNSUPPORTED:
            return nothing(problem, draped.outcome, draped.sentence)
        if not isinstance(draped, Refusal) and _let_go(problem, load, held, draped):
            continue
        hanging = _shape(problem, load, tolerance, None, held, draped, path)
        if hanging.outcome is not Outcome.CONVERGED:
            return hanging
        if _take_up(problem, held, hanging):
            continue
        if clock is not None:
            hanging = _shape(problem, load, tolerance, clock, held, draped, path)
            if _take_up(problem, held, hanging):
                continue
        return _clear_of_faces(problem, hanging, faces)
    return nothing(problem, Outcome.NOT_CONVERGED, f"its contacts do not settle within {CHANGES_MAX} changes")


def _shape(
    problem: Problem, load: np.ndarray, tolerance: float, clock: Clock | None, held: _Held, draped: Draped | Refusal, path: ModuleType
) -> Hanging:
    """The shape on nodes: with a sharp bend at everything it slides over, or, where these would be too wrong, with arcs."""
    if not isinstance(draped, Refusal) and draped.wound <= tolerance:
        return _bent(problem, load, tolerance, clock, held, draped, path)
    if problem.start is not None:
        sentence = draped.sentence if isinstance(draped, Refusal) else WOUND
        return nothing(problem, Outcome.UNSUPPORTED, sentence)
    from .winding import wind  # here: what bends sharply does without

    bends = draped.bends if isinstance(draped, Draped) else None
    stops = draped.stops if isinstance(draped, Draped) else in_order(_holds(problem, held.bonds), _sliding(problem, held))
    return wind(problem, load, tolerance, stops, bends, held.bonds, _meshes(problem), path, clock)


def _drape(problem: Problem, load: np.ndarray, held: _Held) -> Draped | Refusal:
    return drape(_holds(problem, held.bonds), _sliding(problem, held), problem, load)


def _sliding(problem: Problem, held: _Held) -> list[Slide]:
    return [slide for slide in held.sliding if not _is_bonded(slide, problem, held.bonds)]


def _separate(problem: Problem, is_bond: np.ndarray) -> list[int]:
    """Rows of the bonds that hold a place of their own: no second one, none where a gripper holds."""
    contacts, taken, kept = problem.contacts, list(problem.grasps.s), []
    assert contacts is not None
    for index in np.flatnonzero(is_bond).tolist():
        if np.abs(np.array(taken) - contacts.s[index]).min() > 1e-9 * problem.cable.length:
            taken.append(contacts.s[index])
            kept.append(index)
    return kept


def _bond_place(contacts: Contacts, row: int) -> np.ndarray:
    place: np.ndarray = contacts.point[row] + contacts.distance[row] * contacts.normal[row]
    return place


def _holds(problem: Problem, bonds: dict[int, float]) -> list[Hold]:
    grasps, contacts = problem.grasps, problem.contacts
    assert contacts is not None
    holds = [Hold(float(s), place) for s, place in zip(grasps.s, grasps.position, strict=True)]
    holds += [Hold(s, _bond_place(contacts, row)) for row, s in bonds.items()]
    return sorted(holds, key=lambda hold: hold.s)


def _is_bonded(slide: Slide, problem: Problem, bonds: dict[int, float]) -> bool:
    """Whether the cable is bonded to that very point or edge."""
    assert problem.contacts is not None
    for row in bonds:
        away = _bond_place(problem.contacts, row) - slide.point
        away = away - (away @ slide.direction) * slide.direction
        if np.linalg.norm(away) < NEAR * slide.distance:
            return True
    return False


def _let_go(problem: Problem, load: np.ndarray, held: _Held, draped: Draped) -> bool:
    """Let slide, or drop, what pulls hardest; whether anything does."""
    contacts, worst, pull = problem.contacts, None, 0.0
    assert contacts is not None
    bonds = {s: row for row, s in held.bonds.items()}
    for index, stop in enumerate(draped.stops[1:-1], start=1):
        if isinstance(stop, Slide):
            push = draped.outward(index)
        elif stop.s in bonds:
            push = float(draped.push(index) @ contacts.normal[bonds[stop.s]])
        else:
            continue
        if push < pull:
            worst, pull = stop, push
    if worst is None:
        return False
    if isinstance(worst, Slide):
        held.let_go.add(int(worst.rows[0]))
        held.sliding = [slide for slide in held.sliding if slide.rows is not worst.rows]
    elif not _slid(problem, load, held, bonds[worst.s]):
        del held.bonds[bonds[worst.s]]
    return True


def _slid(problem: Problem, load: np.ndarray, held: _Held, row: int) -> bool:
    """Let the cable slide through a bond that pulls to where it does not; whether there is such a place before it would stand still."""
    contacts, start = problem.contacts, held.bonds[row]
    assert contacts is not None

    def balance(s: float) -> tuple[float, float]:
        """Push [N], and the difference of the tensions [N] after and before, with the bond at s."""
        draped = _drape(problem, load, replace(held, bonds=held.bonds | {row: s}))
        stop = -1 if isinstance(draped, Refusal) else next((i for i, hold in enumerate(draped.stops) if hold.s == s), -1)
        if isinstance(draped, Refusal) or not 0 < stop < len(draped.stops) - 1:
            return -np.inf, 0.0
        drawn = float(draped.pieces[stop].tension[0] - draped.pieces[stop - 1].tension[-1])
        return float(draped.push(stop) @ contacts.normal[row]), drawn

    way = -float(np.sign(balance(start)[1]))
    near, far = 0.0, SLIDE_LEAST * problem.cable.length
    push, drawn = balance(start + way * far)
    while push < 0.0 and drawn * way < 0.0:
        near, far = far, 2.0 * far
        push, drawn = balance(start + way * far)
    if push < 0.0:  # beyond where it would stand still: there it would push most
        low = near
        for _ in range(SLIDE_HALVINGS):
            middle = 0.5 * (low + far)
            low, far = (middle, far) if balance(start + way * middle)[1] * way < 0.0 else (low, middle)
        if balance(start + way * far)[0] < 0.0:
            return False
    for _ in range(SLIDE_HALVINGS):
        middle = 0.5 * (near + far)
        near, far = (near, middle) if balance(start + way * middle)[0] >= 0.0 else (middle, far)
    held.bonds[row] = start + way * far
    return True


def _bent(
    problem: Problem, load: np.ndarray, tolerance: float, clock: Clock | None, held: _Held, draped: Draped, path: ModuleType
) -> Hanging:
    """The shape on nodes, with one at every sharp bend; forces and places by the rows of the request."""
    contacts, grasps = problem.contacts, problem.grasps
    assert contacts is not None
    slides = [(index, stop) for index, stop in enumerate(draped.stops) if isinstance(stop, Slide)]
    s = np.concatenate([grasps.s, list(held.bonds.values()), [slide.s for _, slide in slides]])
    points = np.vstack([grasps.position, *(_bond_place(contacts, row) for row in held.bonds), *(slide.place for _, slide in slides)])

    def made(mesh: Mesh) -> Hanging:
        return pieces_of(problem, load, with_nodes_at(mesh, s[len(grasps.s) :]), s, points, path)

    hanging = on_finer(made, _meshes(problem), tolerance, clock)
    forces, places = np.zeros((len(contacts.s), 3)), contacts.s.copy()
    forces[list(held.bonds)] = hanging.contact_forces[: len(held.bonds)]
    places[list(held.bonds)] = list(held.bonds.values())
    for index, slide in slides:
        places[slide.rows] = slide.s
        _share(slide, draped, index, contacts, forces)
    return replace(hanging, contact_forces=forces, contact_s=places, sag=hanging.sag + draped.wound)


def _share(slide: Slide, draped: Draped, stop: int, contacts: Contacts, forces: np.ndarray) -> None:
    """The push of a bend, along the normals of both pieces, on the rows beside it; on one row if there is one."""
    force = draped.push(stop)
    before = slide.rows[contacts.s[slide.rows] <= slide.s]
    after = slide.rows[contacts.s[slide.rows] > slide.s]
    tangents = [draped.pieces[stop - 1].end_force, draped.pieces[stop].start_force]
    normals = []
    for tangent in tangents:
        normal = force - (force @ tangent) / max(float(tangent @ tangent), 1e-300) * tangent
        normals.append(normal / max(float(np.linalg.norm(normal)), 1e-300))
    nearest = [own[np.argmin(np.abs(contacts.s[own] - slide.s))] if len(own) else -1 for own in (before, after)]
    if min(nearest) < 0:
        forces[max(nearest)] = force
        return
    both = normals[0] + normals[1]
    size = float(force @ both) / float(both @ both)
    forces[nearest[0]] = size * normals[0]
    forces[nearest[1]] = force - size * normals[0]


def _meshes(problem: Problem) -> list[Mesh]:
    """Meshes to try in turn: that of the start, or ever finer ones."""
    grasps, length = problem.grasps.s, problem.cable.length
    if problem.start is None:
        return [even(stops(problem), grasps, segments) for segments in SEGMENTS]
    # Nodes that earlier contacts moved go back to where they belong.
    mesh = even(stops(problem), grasps, len(problem.start.s) - 1)
    return [mesh if len(mesh.s) == len(problem.start.s) else from_nodes(np.array(problem.start.s), length, grasps)]


def _take_up(problem: Problem, held: _Held, hanging: Hanging) -> bool:
    """Take up the contact that the cable passes through most; whether there is one."""
    best, worst, where = -PASSED, None, 0.0
    for slide in held.open:
        if int(slide.rows[0]) in held.let_go or _is_bonded(slide, problem, held.bonds):
            continue
        size, place = gap(slide, hanging.nodes, hanging.mesh.s, 2.0 * float(hanging.mesh.lengths.max()))
        if size < best:
            best, worst, where = size, slide, place
    if worst is None:
        return False
    held.open = [slide for slide in held.open if slide.rows is not worst.rows]
    held.sliding.append(replace(worst, s=where))
    return True


def _clear_of_faces(problem: Problem, hanging: Hanging, faces: np.ndarray) -> Hanging:
    """The shape, unless it needs what is not built: to lie on a face."""
    contacts = problem.contacts
    assert contacts is not None
    for row in faces.tolist() if hanging.outcome is Outcome.CONVERGED else ():
        at = np.array([np.interp(contacts.s[row], hanging.mesh.s, hanging.nodes[:, k]) for k in range(3)])
        if (at - contacts.point[row]) @ contacts.normal[row] < contacts.distance[row] - PASSED:
            sentence = "a cable without bending meets points and edges, and faces only with a bond; give it 'bending' and 'twist'"
            return nothing(problem, Outcome.UNSUPPORTED, sentence)
    return hanging
