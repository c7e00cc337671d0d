"""Contacts at their worst: at a node and between nodes, on a knife edge, in a corner, squeezed, impossible, random.

The cable sags between two clamps over features that would touch it. Invariants: the forces balance; no contact pulls; the axis stays as far
from the feature as it should; the force does not depend on the mesh; what says the same twice changes nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from types import ModuleType
from typing import Final

import numpy as np

from protocol.hard_case import Case, Check
from protocol.kinds import Feature, Friction, Model
from protocol.messages import Problem, Shape

from .answers import found
from .balance import balance
from .posing import ALONG_X, GRAVITY, RADIUS, Row, apart, cable, contacts, grasps, place, span, start_from
from .sagging import free

FAMILY: Final = "contacts"
ACROSS: Final = (0.0, 1.0, 0.0)
IMPOSSIBLE: Final = {
    "in the air": ((0.3, 0.0, 3.0), 0.5),
    "in the clamp": ((0.0, 0.0, 0.1), 0.0),
    "at the clamp": ((0.0, 0.0, 0.1), 0.02),
}
REFUSED: Final = (12, 25)  # seeds
PASSING: Final = (43, 66, 156, 170)  # seeds; the cable passes an edge a second time, 1 to 1.9 mm too near, and the answer says so


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for count in (49, 50, 100, 101):
        for s in (0.5, 0.503, 0.51):
            for rise in (1e-4, 1e-3, 1e-2):
                yield Case(f"edge at {s:g} m, {rise:g} m up, {count} segments", FAMILY, partial(_edge_on_mesh, count, s, rise))
        yield Case(f"face at a node, {count} segments", FAMILY, partial(_face_on_mesh, count))
    for rise in (1e-3, 1e-2, 5e-2):
        yield Case(
            f"edge {rise:g} m up, force on 60 and on 120 segments", FAMILY, partial(_independent_of_mesh, rise), may_decline=rise > 0.02
        )
    for distance in (0.0, 1e-6, 1e-4):
        yield Case(f"knife edge of radius {distance:g} m", FAMILY, partial(_knife, distance))
    for angle in (0.5, 0.2, 0.06, 0.04, 0.01, 1e-3, 1e-6, 0.0):
        yield Case(f"edge at {angle:g} rad to the cable", FAMILY, partial(_along, angle), may_decline=0.036 < angle < 0.044)
    for tilt in (0.3, 0.8, 1.2):
        yield Case(f"corner of two faces, tilted by {tilt:g} rad", FAMILY, partial(_corner, tilt))
        yield Case(f"corner of two edges, tilted by {tilt:g} rad", FAMILY, partial(_lip, tilt))
    for gap in (1e-3, 1e-6, 0.0, -1e-3):
        yield Case(f"squeezed between two faces with {gap:g} m to spare", FAMILY, partial(_squeezed, gap), may_decline=gap < 0)
    for push in (1e-4, 1e-2, 0.1):
        yield Case(f"free end pushed end-on by {push:g} m", FAMILY, partial(_end_on, push))
    for rise in (0.02, 0.1, 0.2):
        yield Case(f"edge that starts {rise:g} m inside", FAMILY, partial(_edge_on_mesh, 100, 0.5, rise), may_decline=True)
    for count in (2, 5, 20, 200):
        yield Case(f"one edge given {count} times", FAMILY, partial(_repeated, count))
    for force in (1.0, 1e4, 1e8):
        yield Case(f"wild force of {force:g} N to start from", FAMILY, partial(_wild, force))
    for name, (point, s) in IMPOSSIBLE.items():
        yield Case(f"face that cannot be met, {name}", FAMILY, partial(_impossible, point, s), may_decline=True)
    for seed in (*range(20), 25):
        yield Case(f"random rows, seed {seed}", FAMILY, partial(_random_rows, seed), may_decline=seed in REFUSED)
    for seed in PASSING:
        yield Case(f"random rows, seed {seed}", FAMILY, partial(_random_rows, seed), may_decline=True)


def _touched(path: ModuleType, *rows: Row, count: int = 100) -> tuple[Problem, Shape]:
    problem = Problem(cable=cable(), grasps=span(), contacts=contacts(*rows), start=start_from(free(path, count)), model=Model.ROD)
    return problem, found(problem, GRAVITY, path, extrapolate=False)


def _edge(path: ModuleType, s: float, rise: float, count: int = 100, **changes: object) -> Row:
    """An edge under the cable at arc length s, raised by `rise` [m] over where it would just touch."""
    at = place(free(path, count), s)
    fields: dict[str, object] = {"direction": ACROSS, "feature": Feature.EDGE} | changes
    return Row(s=s, point=at + np.array([0.0, 0.0, rise - RADIUS]), **fields)  # type: ignore[arg-type]


def _clearance(shape: Shape, row: Row) -> float:
    """[m] Smallest distance of the axis polygon from an edge, or from a point without a direction."""
    direction = np.asarray(row.direction, dtype=float)
    arms = shape.nodes - np.asarray(row.point)
    flat = arms - np.outer(arms @ direction, direction)
    sides = np.diff(flat, axis=0)
    share = np.clip(-np.einsum("ij,ij->i", flat[:-1], sides) / np.maximum(np.einsum("ij,ij->i", sides, sides), 1e-300), 0.0, 1.0)
    return float(np.linalg.norm(flat[:-1] + share[:, None] * sides, axis=1).min())


def _invariants(problem: Problem, shape: Shape, *rows: Row, within: float = 1e-4) -> Iterable[Check]:
    """Balance, no pull, no penetration."""
    yield from list(balance(problem, shape, GRAVITY))[1:]
    weight = 0.981
    for row, force in zip(rows, shape.contact_forces, strict=True):
        if row.feature is Feature.FACE and row.friction is Friction.NONE:
            yield Check("pull of a face", float(-(force @ np.asarray(row.normal))), 1e-9 * weight, "N")
            inside = row.distance - float((place(shape, row.s) - np.asarray(row.point)) @ np.asarray(row.normal))
            yield Check("penetration of a face", inside, 1e-6)
        if row.feature is Feature.EDGE:
            yield Check("force along an edge", abs(float(force @ np.asarray(row.direction))) / weight, 1e-2, "of the weight")
            if row.extent == (-1.0, 1.0):
                yield Check("penetration of an edge", row.distance - _clearance(shape, row), within, told=shape.error or 0.0)


def _edge_on_mesh(count: int, s: float, rise: float, path: ModuleType) -> Iterable[Check]:
    row = _edge(path, s, rise, count)
    problem, shape = _touched(path, row, count=count)
    yield Check("push of the edge", -float(shape.contact_forces[0, 2]), 1e-12, "N")
    yield from _invariants(problem, shape, row)


def _face_on_mesh(count: int, path: ModuleType) -> Iterable[Check]:
    at = place(free(path, count), 0.5) + np.array([0.0, 0.0, 2e-3 - RADIUS])
    row = Row(s=0.5, point=at)
    problem, shape = _touched(path, row, count=count)
    return _invariants(problem, shape, row)


def _independent_of_mesh(rise: float, path: ModuleType) -> Iterable[Check]:
    low = place(free(path, 240), 0.5) + np.array([0.0, 0.0, rise - RADIUS])
    row = Row(s=0.5, point=low, feature=Feature.EDGE, direction=ACROSS)
    coarse, fine = (_touched(path, row, count=count)[1] for count in (60, 120))
    force = float(fine.contact_forces[0, 2])
    # The polygon of the coarse mesh lies lower at the edge than the curve by up to curvature h^2 / 8, with 1/m about 6.
    lower = 6 / 60**2 / 8
    yield Check("force on one mesh against the other", abs(float(coarse.contact_forces[0, 2]) / force - 1), 0.01 + lower / rise, "of it")
    yield Check("place of a node", apart(coarse, fine), 1e-3)


def _knife(distance: float, path: ModuleType) -> Iterable[Check]:
    at = place(free(path), 0.503) + np.array([0.0, 0.0, 3e-3 - distance])
    row = Row(s=0.503, point=at, feature=Feature.EDGE, direction=ACROSS, distance=distance)
    problem, shape = _touched(path, row)
    yield from _invariants(problem, shape, row)
    yield Check("lift of the cable", 3e-3 - float(np.interp(0.3, shape.nodes[:, 0], shape.nodes[:, 2]) - at[2] + 3e-3 - distance), 1e-3)


def _along(angle: float, path: ModuleType) -> Iterable[Check]:
    row = _edge(path, 0.5, 5e-3, direction=(np.cos(angle), np.sin(angle), 0.0))
    problem, shape = _touched(path, row)
    return _invariants(problem, shape, row)


def _corner(tilt: float, path: ModuleType) -> Iterable[Check]:
    """A groove whose two faces rise to both sides of the cable, touched by the same three places each."""
    rows = []
    for side in (-1.0, 1.0):
        normal = np.array([0.0, side * np.sin(tilt), np.cos(tilt)])
        rows += [Row(s=s, point=place(free(path), s) - (RADIUS - 3e-3) * normal, normal=normal) for s in (0.45, 0.5, 0.55)]
    problem, shape = _touched(path, *rows)
    yield from _invariants(problem, shape, *rows)
    yield Check("lean to one side", float(np.abs(shape.nodes[:, 1]).max()), 1e-7)


def _lip(tilt: float, path: ModuleType) -> Iterable[Check]:
    """Two edges that meet under the cable and fall away to both sides."""
    corner = place(free(path), 0.5) + np.array([0.0, 0.0, 5e-3 - RADIUS])
    rows = []
    for side in (-1.0, 1.0):
        along = np.array([0.0, side * np.cos(tilt), -np.sin(tilt)])
        rows.append(Row(s=0.5, point=corner, direction=along, feature=Feature.EDGE, extent=(0.0, 0.3)))
    problem, shape = _touched(path, *rows)
    yield from list(balance(problem, shape, GRAVITY))[1:]
    yield Check("penetration of the corner", RADIUS - _clearance(shape, Row(s=0.5, point=corner)), 2e-4)


def _squeezed(gap: float, path: ModuleType) -> Iterable[Check]:
    """A ceiling above the lowest point and a floor below it, nearer to each other than the cable is thick when the gap is below zero."""
    middle = float(free(path).nodes[:, 2].min()) + 0.02
    rows = [
        Row(s=0.5, point=(0.3, 0.0, middle - RADIUS - gap / 2)),
        Row(s=0.5, point=(0.3, 0.0, middle + RADIUS + gap / 2), normal=(0.0, 0.0, -1.0)),
    ]
    problem, shape = _touched(path, *rows)
    return _invariants(problem, shape, *rows)


def _end_on(push: float, path: ModuleType) -> Iterable[Check]:
    """A wall that the free end of a level cable runs into."""
    held = grasps((0.0, (0.0, 0.0, 0.0), ALONG_X))
    alone = found(Problem(cable=cable(bending=0.2), grasps=held, model=Model.ROD), GRAVITY, path, extrapolate=False)
    row = Row(s=1.0, point=(float(alone.nodes[-1, 0]) - push + RADIUS, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
    problem = Problem(cable=cable(bending=0.2), grasps=held, contacts=contacts(row), start=start_from(alone), model=Model.ROD)
    shape = found(problem, GRAVITY, path, extrapolate=False)
    yield from _invariants(problem, shape, row)
    yield Check("push of the wall", float(shape.contact_forces[0, 0]), 1e-12, "N")


def _repeated(count: int, path: ModuleType) -> Iterable[Check]:
    row = _edge(path, 0.51, 1e-3)
    one, many = _touched(path, row)[1], _touched(path, *[row] * count)[1]
    apart_by = float(np.linalg.norm(many.contact_forces.sum(axis=0) - one.contact_forces[0]))
    yield Check("sum of the forces against the one", apart_by, 1e-3 * float(np.linalg.norm(one.contact_forces[0])) + 1e-6, "N")
    yield Check("place of a node", apart(many, one), 1e-6)


def _wild(force: float, path: ModuleType) -> Iterable[Check]:
    calm, wild = (_touched(path, _edge(path, 0.51, 1e-3, force=(0.0, 0.0, size)))[1] for size in (0.0, force))
    yield Check("place of a node", apart(wild, calm), 1e-5)


def _impossible(point: tuple[float, float, float], s: float, path: ModuleType) -> Iterable[Check]:
    row = Row(s=s, point=point)
    problem, shape = _touched(path, row)
    return _invariants(problem, shape, row)


def _random_rows(seed: int, path: ModuleType) -> Iterable[Check]:
    """Up to six faces and edges beside the cable, on all sides of it, the edges at 45 degrees to it or more."""
    rng = np.random.default_rng(seed)
    rows = []
    for _ in range(int(rng.integers(1, 7))):
        s = float(rng.uniform(0.02, 0.98))
        tangent = place(free(path), s + 1e-3) - place(free(path), s - 1e-3)
        tangent /= np.linalg.norm(tangent)
        aside = rng.normal(size=3)
        normal = aside - aside @ tangent * tangent
        normal /= np.linalg.norm(normal)
        direction = np.cross(normal, tangent) + rng.uniform(-1.0, 1.0) * tangent
        point = place(free(path), s) - (RADIUS - rng.uniform(-2e-3, 4e-3)) * normal
        edge = rng.random() < 0.5
        along = direction / np.linalg.norm(direction) if edge else (0.0, 0.0, 0.0)
        rows.append(Row(s=s, point=point, normal=normal, direction=along, feature=Feature.EDGE if edge else Feature.FACE))
    problem, shape = _touched(path, *rows)
    return _invariants(problem, shape, *rows, within=5e-4)
