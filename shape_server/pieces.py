"""A cable clamped along its way falls into pieces that know nothing of each other: each is solved for itself.

A clamp holds position and frame, so what happens on one side of it is not felt on the other. A hundred clamps are then a
hundred small problems with two ends each, instead of one with three hundred coupled forces.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Final

import msgspec
import numpy as np

from protocol.kinds import Hold, Outcome
from protocol.messages import Contacts, Cost, Grasps, PointLoads, Problem, Rubbed, Rubbing, Shape, Start
from protocol.scene import Cable, Vector

from .mesh import from_nodes

END: Final = 1e-9  # of the length; a clamp this near to an end of the cable cuts nothing off


def cuts(problem: Problem) -> list[float]:
    """Arc lengths [m] of the ends of all pieces, in order; just the two ends of the cable if no clamp is inside it."""
    length, held = problem.cable.length, problem.grasps
    inside = [float(s) for s, hold in zip(held.s, held.hold, strict=True) if hold is Hold.CLAMP and END < s / length < 1 - END]
    return [0.0, *inside, length]


def split(problem: Problem, gravity: Vector) -> list[Problem]:
    """The pieces of a cable as problems of their own, arc length counted from the start of each."""
    ends = cuts(problem)
    if problem.start is not None:
        from_nodes(problem.start.s, problem.cable.length, problem.grasps.s)  # refuses a start that misses a cut
    places = [of_piece(problem, first, last) for first, last in pairwise(ends)]
    forces = _start_forces(problem, gravity, ends, places)
    pieces = []
    for (first, last), (grasps, contacts), force in zip(pairwise(ends), places, forces, strict=True):
        held, touched, start = problem.grasps, problem.contacts, problem.start
        pieces.append(
            Problem(
                cable=_cable(problem.cable, first, last),
                grasps=Grasps(
                    s=np.clip(held.s[grasps] - first, 0.0, last - first),
                    position=held.position[grasps],
                    quaternion=held.quaternion[grasps],
                    hold=tuple(held.hold[k] for k in grasps),
                ),
                contacts=_part_of(touched, contacts, first) if touched is not None and len(contacts) else None,
                start=_start(start, first, last, problem.cable.length, force) if start is not None else None,
                loads=_loads(problem.loads, first, last, problem.cable.length),
                model=problem.model,
                turns=_turns(problem, grasps),
                branch=problem.branch,
            )
        )
    return pieces


def join(problem: Problem, shapes: list[Shape]) -> Shape:
    """The shape of a cable from those of its pieces; the first that has none speaks for all."""
    ends = cuts(problem)
    costs = [shape.cost for shape in shapes]
    cost = Cost(
        solve=sum(cost.solve for cost in costs),
        estimate=sum(cost.estimate for cost in costs),
        certify=sum(cost.certify for cost in costs),
        factorisations=sum(cost.factorisations for cost in costs),
        path=costs[0].path,
    )
    iterations = sum(shape.iterations for shape in shapes)
    for (first, last), shape in zip(pairwise(ends), shapes, strict=True):
        if shape.outcome is not Outcome.CONVERGED:
            sentence = f"between s = {first:.4g} and {last:.4g} m: {shape.sentence}"
            wrenches = np.zeros((len(problem.grasps.s), 6))
            return msgspec.structs.replace(shape, sentence=sentence, grasp_wrenches=wrenches, iterations=iterations, cost=cost)
    wrenches, curvature = np.zeros((len(problem.grasps.s), 6)), [shapes[0].curvature]
    count = 0 if problem.contacts is None else len(problem.contacts.s)
    contact_forces, contact_moments, contact_s = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count)
    for (first, last), shape in zip(pairwise(ends), shapes, strict=True):
        grasps, contacts = of_piece(problem, first, last)
        wrenches[grasps] += shape.grasp_wrenches
        contact_forces[contacts], contact_moments[contacts] = shape.contact_forces, shape.contact_moments
        contact_s[contacts] = shape.contact_s + first
    for shape in shapes[1:]:
        curvature[-1] = np.append(curvature[-1][:-1], max(curvature[-1][-1], shape.curvature[0]))
        curvature.append(shape.curvature[1:])
    sentences = list(dict.fromkeys(shape.sentence for shape in shapes))
    return msgspec.structs.replace(
        shapes[0],
        s=np.concatenate([shapes[0].s, *(shape.s[1:] + first for first, shape in zip(ends[1:-1], shapes[1:], strict=True))]),
        nodes=np.concatenate([shapes[0].nodes, *(shape.nodes[1:] for shape in shapes[1:])]),
        frames=np.concatenate([shape.frames for shape in shapes]),
        tension=np.concatenate([shape.tension for shape in shapes]),
        curvature=np.concatenate(curvature),
        grasp_wrenches=wrenches,
        contact_forces=contact_forces,
        contact_moments=contact_moments,
        contact_s=contact_s,
        effects=tuple(dict.fromkeys(name for shape in shapes for name in shape.effects)),
        sentence=f"{len(shapes)} pieces between clamps; {'; '.join(sentences)}",
        error=_worst(max, [shape.error for shape in shapes]),
        error_tension=_worst(max, [shape.error_tension for shape in shapes]),
        error_curvature=_worst(max, [shape.error_curvature for shape in shapes]),
        residual=max(shape.residual for shape in shapes),
        iterations=iterations,
        energy=sum(shape.energy for shape in shapes),
        total_twist=sum(shape.total_twist for shape in shapes),
        is_stable=all(shape.is_stable for shape in shapes),
        margin=_worst(min, [shape.margin for shape in shapes]),
        fold=min((shape.fold for shape in shapes if shape.fold is not None), default=None),
        cost=cost,
        rubbed=_rubbed(problem, shapes),
    )


def _rubbed(problem: Problem, shapes: list[Shape]) -> Rubbed | None:
    """What is left of the contacts that rub, in the order of the request's."""
    if problem.contacts is None or problem.contacts.rubbing is None:
        return None
    rubs, ends = problem.contacts.rubbing.contact, cuts(problem)
    s, anchor, is_sticking = np.zeros(len(rubs)), np.zeros((len(rubs), 3)), np.zeros(len(rubs), dtype=np.int64)
    for (first, last), shape in zip(pairwise(ends), shapes, strict=True):
        own = np.flatnonzero(np.isin(rubs, of_piece(problem, first, last)[1]))
        if len(own) and shape.rubbed is not None:
            s[own], anchor[own], is_sticking[own] = shape.rubbed.s + first, shape.rubbed.anchor, shape.rubbed.is_sticking
    return Rubbed(s=s, anchor=anchor, is_sticking=is_sticking)


def _worst(choose: Callable[[list[float]], float], values: list[float | None]) -> float | None:
    """The worst of all; None if one of them is not known."""
    known = [value for value in values if value is not None]
    return choose(known) if len(known) == len(values) else None


def _cable(cable: Cable, first: float, last: float) -> Cable:
    """The part of a cable from one arc length to another; a mass at a cut goes with the part before."""
    sections = tuple(
        replace(section, start=max(section.start - first, 0.0), end=min(section.end, last) - first)
        for section in cable.sections
        if section.end > first and section.start < last
    )
    masses = tuple(replace(mass, at=mass.at - first) for mass in cable.masses if first < mass.at <= last or mass.at == first == 0.0)
    return replace(cable, length=last - first, sections=sections, masses=masses)


def _loads(loads: PointLoads | None, first: float, last: float, length: float) -> PointLoads | None:
    if loads is None:
        return None
    inside = (loads.s > first) & (loads.s <= last) | ((loads.s == 0.0) & (first == 0.0))
    return PointLoads(s=loads.s[inside] - first, force=loads.force[inside]) if inside.any() else None


def _turns(problem: Problem, grasps: np.ndarray) -> tuple[int, ...]:
    """Whole turns between the clamps of one piece."""
    if not problem.turns:
        return ()
    framed = [k for k, hold in enumerate(problem.grasps.hold) if hold is not Hold.HINGE]
    own = [framed.index(k) for k in grasps.tolist() if k in framed]
    return problem.turns[own[0] : own[-1]] if len(own) > 1 else ()


def of_piece(problem: Problem, first: float, last: float) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the grasps and of the contacts of one piece; a clamp between two pieces belongs to both."""
    near = END * problem.cable.length
    held = problem.grasps.s
    grasps = np.flatnonzero((held >= first - near) & (held <= last + near))
    if problem.contacts is None:
        return grasps, np.zeros(0, dtype=np.int64)
    s = problem.contacts.s
    is_last = last == problem.cable.length
    return grasps, np.flatnonzero((s >= first) & ((s <= last) if is_last else (s < last)))


def _part_of(contacts: Contacts, chosen: np.ndarray, first: float) -> Contacts:
    given = {name: getattr(contacts, name) for name in contacts.__struct_fields__ if name != "rubbing"}
    columns = {name: column[chosen] for name, column in given.items() if column is not None}
    columns["s"] = columns["s"] - first
    return Contacts(**columns, rubbing=_rubbing(contacts.rubbing, chosen, first))


def _rubbing(rubbing: Rubbing | None, chosen: np.ndarray, first: float) -> Rubbing | None:
    """Of the contacts `chosen`; what was held on another piece is held at the end of this one."""
    if rubbing is None:
        return None
    own = np.flatnonzero(np.isin(rubbing.contact, chosen))
    if not len(own):
        return None
    return Rubbing(
        contact=np.searchsorted(chosen, rubbing.contact[own]),
        law=rubbing.law[own],
        s=rubbing.s[own] - first,
        anchor=rubbing.anchor[own],
        laws=rubbing.laws,
        time_step=rubbing.time_step,
    )


def _start(start: Start, first: float, last: float, length: float, forces: np.ndarray) -> Start:
    near = END * length
    nodes = np.flatnonzero((start.s >= first - near) & (start.s <= last + near))
    s = start.s[nodes] - first
    if len(s):
        s[0], s[-1] = (0.0 if abs(s[0]) <= near else s[0]), (last - first if abs(s[-1] - last + first) <= near else s[-1])
    return Start(s=s, frames=start.frames[nodes[:-1]], grasp_forces=forces, margin=start.margin)


def _start_forces(problem: Problem, gravity: Vector, ends: list[float], places: list[tuple[np.ndarray, np.ndarray]]) -> list[np.ndarray]:
    """Forces at the grasps of every piece (g, 3) [N] to start from: the share of each clamp, from one end of the cable on.

    A piece is in balance, so what its last clamp gives it follows from the rest; the next piece has what is left of that clamp.
    """
    out = []
    left = np.zeros(3)  # what the clamp between two pieces gives the one before
    for number, ((first, last), (grasps, contacts)) in enumerate(zip(pairwise(ends), places, strict=True)):
        force = problem.start.grasp_forces[grasps].copy() if problem.start is not None else np.zeros((len(grasps), 3))
        if number > 0:
            force[0] -= left
        if number < len(places) - 1:
            weight = (last - first) * problem.cable.mass_per_length * np.asarray(gravity)
            touch = problem.contacts.force[contacts].sum(axis=0) if problem.contacts is not None else np.zeros(3)
            left = -(weight + touch + force[:-1].sum(axis=0))
            force[-1] = left
        out.append(force)
    return out
