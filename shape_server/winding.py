"""The answer that a cable without bending is which lies round thick bodies: its nodes, and which contacts bear how much of every arc."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import ModuleType

import numpy as np

from protocol.kinds import Outcome
from protocol.messages import Contacts, Problem

from .arcs import Arc, Laid
from .clock import Clock
from .hanging import CLOSED_FORM, Hanging, nothing, on_finer, pieces_of
from .mesh import Mesh, with_nodes_at
from .slides import Bend, Hold, Slide
from .wrapped import wrap

PULLS = 1e-9  # of the weight per metre; an arc that is pressed on by less lifts off inside


def wind(
    problem: Problem,
    load: np.ndarray,
    tolerance: float,
    stops: tuple[Hold | Slide, ...],
    bends: Sequence[Bend] | None,
    bonds: dict[int, float],
    meshes: Sequence[Mesh],
    path: ModuleType,
    clock: Clock | None = None,
) -> Hanging:
    """The shape round what it touches, on the first mesh that is fine enough, or by a clock; or why there is none.

    Args:
        problem: Without stretch.
        load: (3,) [N/m].
        tolerance: [m].
        stops: Held points, bonds among them, and contacts, in order.
        bends: At the contacts, where sharp ones are known.
        bonds: Arc lengths [m] by rows of the request.
        meshes: To try in turn, for nodes at given places.
        path: Kernels.
        clock: Says how fine the mesh may be, in the place of the tolerance.
    """
    if problem.cable.stretch is not None:
        sentence = (
            "a cable that stretches but does not bend lies round nothing thick; leave out 'stretch', or give it 'bending' and 'twist'"
        )
        return nothing(problem, Outcome.UNSUPPORTED, sentence)
    grasps, contacts = problem.grasps, problem.contacts
    assert contacts is not None
    found = wrap(stops, load, bends) if bends is not None else ""
    if isinstance(found, str):
        found = wrap(tuple(_amid(stop, contacts) if isinstance(stop, Slide) else stop for stop in stops), load)
    if isinstance(found, str):
        return nothing(problem, Outcome.NOT_CONVERGED, found)
    arcs = [stop for stop in found.stops if isinstance(stop, Arc)]
    for arc, laid in zip(arcs, found.arcs, strict=True):
        sentence = _refused(arc, laid, float(np.linalg.norm(load)))
        if sentence:
            return nothing(problem, Outcome.UNSUPPORTED, sentence)
    bonded = [stop for stop in found.stops if isinstance(stop, Hold) and stop.s in bonds.values()]
    s = np.concatenate([grasps.s, list(bonds.values()), *(laid.s[[0, -1]] for laid in found.arcs)])
    places = [next(stop.place for stop in bonded if stop.s == at) for at in bonds.values()]
    points = np.vstack([grasps.position, *places, *(laid.nodes[[0, -1]] for laid in found.arcs)])

    def made(mesh: Mesh) -> Hanging:
        return pieces_of(problem, load, with_nodes_at(mesh, s[len(grasps.s) :]), s, points, path, found.arcs)

    hanging = on_finer(made, meshes, tolerance, clock)
    forces = np.zeros((len(contacts.s), 3))
    forces[list(bonds)] = hanging.contact_forces[: len(bonds)]
    for arc, laid in zip(arcs, found.arcs, strict=True):
        _share(arc.slide.rows, contacts, laid, load, forces)
    at = contacts.s.copy()
    at[list(bonds)] = list(bonds.values())
    sentence = "closed form and arcs" if hanging.sentence == CLOSED_FORM else hanging.sentence
    return replace(hanging, contact_forces=forces, contact_s=at, sentence=sentence)


def _amid(slide: Slide, contacts: Contacts) -> Slide:
    """The contact in the middle of all its places that push."""
    push = np.maximum(np.einsum("ij,ij->i", contacts.force[slide.rows], contacts.normal[slide.rows]), 0.0)
    normal = push @ contacts.normal[slide.rows]
    size = float(np.linalg.norm(normal))
    if size == 0.0:
        return slide
    return replace(slide, normal=normal / size, s=float(push @ contacts.s[slide.rows] / push.sum()))


def _refused(arc: Arc, laid: Laid, weight: float) -> str:
    """What is not built of an arc; empty if it is."""
    if laid.pressure.min() < -PULLS * weight:
        at = laid.s[int(np.argmin(laid.pressure))]
        return f"at s = {at:.4g} m the cable would lift off what it lies round on both sides; give it 'bending' and 'twist'"
    along = (laid.nodes - arc.slide.point) @ arc.slide.direction
    if arc.slide.direction.any() and not (arc.slide.extent[0] <= along.min() and along.max() <= arc.slide.extent[1]):
        return (
            f"at s = {laid.s[0]:.4g} m the cable comes to an end of what it lies round; make that longer, or give it 'bending' and 'twist'"
        )
    return ""


def _share(rows: np.ndarray, contacts: Contacts, laid: Laid, load: np.ndarray, forces: np.ndarray) -> None:
    """What presses on an arc, on the rows within it: each bears its part of it, up to halfway to the next."""
    own = rows[np.argsort(contacts.s[rows], kind="stable")]
    inside = own[(contacts.s[own] >= laid.s[0]) & (contacts.s[own] <= laid.s[-1])]
    if not len(inside):
        inside = own[[int(np.argmin(np.abs(contacts.s[own] - 0.5 * (laid.s[0] + laid.s[-1]))))]]
    cuts = np.concatenate([laid.s[:1], 0.5 * (contacts.s[inside][1:] + contacts.s[inside][:-1]), laid.s[-1:]])
    pulls = np.column_stack([np.interp(cuts, laid.s, column) for column in laid.force.T])
    forces[inside] = pulls[:-1] - pulls[1:] - np.outer(cuts[1:] - cuts[:-1], load)
