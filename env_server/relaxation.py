"""The motion of a cable from one equilibrium to another, after contact was lost or the shape has snapped (section 5.3 of the paper).

The simulation is quasi-static: a cable that snaps is in its next equilibrium at once. What is shown between is artificial. Every
node goes straight from its place in the one posture to its place in the other, with the polynomial of Eq. 1 that has zero velocity
and acceleration at both ends:

    r(t) = r_0 + (r_1 - r_0) s(t / T),   s(u) = 10 u^3 - 15 u^4 + 6 u^5

With an overshoot o the share is that of a damped oscillator after a step, two periods of it, started and ended smoothly:

    y(tau) = 1 - e^(-a tau) (cos tau + a sin tau),   a = -ln(o) / pi          (Ogata, "Modern control engineering", section 5.3)

Nodes are counted along the cable, and where a cable without bending runs over a body, along each part of it beside that body.

The time T is given, or that of a pendulum in air, linearised. Hanging between two held points the cable swings about the line through
them; with r the distance of its nodes from that line and g gravity, w^2 = g sum(r) / sum(r^2). Air of density rho pushes with rho c D
v^2 / 2 per metre against it; for an amplitude A that is as much damping as (4 / 3 pi) rho c D w A per metre (the same energy in a
period), so that zeta = (2 / 3 pi) rho c D A / m, with m the mass per metre. From rest the pendulum is back at its equilibrium after

    T = (pi / 2 + asin(zeta)) / (w sqrt(1 - zeta^2))

Air damps a cable of 90 g/m so little (zeta below 0.01) that it would swing for minutes; wires that rub against each other stop a
real one far sooner, and are not in these numbers.

What counts as a snap is in `snap.py`.

Source: c = 1.2 across a cylinder and rho = 1.2 kg/m^3: Hoerner 1965, "Fluid-dynamic drag", ch. 3.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import msgspec
import numpy as np

from protocol.scene import Relaxation

from .boundary import NO_PUSHES
from .hanging import Hanging
from .motion import quintic
from .polyline import points_at
from .remesh import blended
from .snap import Tried, farthest, has_snapped
from .stage import Posture, Stage
from .stepped import Stepped

AIR, DRAG = 1.2, 1.2  # kg/m^3; of a cylinder across the flow
PERIODS: Final = 2.0  # of the oscillation that are shown
CALM: Final = 0.6  # share of the time after which an oscillation is led to rest


@dataclass(frozen=True)
class Moment:
    """One moment between two equilibria."""

    time: float  # s after the first of them
    share: float  # of the time that has passed, above 0 and below 1
    stepped: Stepped


def between(stage: Stage, tried: Tried, before: Stepped, after: Stepped, given: Relaxation) -> tuple[float, Iterator[Moment]] | None:
    """How long the cables take from one step to the next [s], and the moments on their way; None if they have not snapped."""
    if not any(has_snapped(stage, tried, before, after, index) for index in range(len(after.cables))):
        return None
    time = given.time if given.time is not None else max(_estimated(stage, before, after, i, given) for i in range(len(after.cables)))
    count = max(1, math.ceil(time / stage.scene.time_step - 1e-6))
    return time, (_moment(stage, before, after, time, step / count, given) for step in range(1, count))


def share_of_way(passed: float, overshoot: float) -> float:
    """Share of its way that every node has gone when a share of the time has passed; above 1 where it overshoots."""
    if overshoot == 0.0:
        return quintic(passed)
    ease = 0.1
    ramp = passed * passed / (2.0 * ease) if passed < ease else passed - 0.5 * ease
    angle, damping = 2.0 * math.pi * PERIODS * ramp / (1.0 - 0.5 * ease), -math.log(overshoot) / math.pi
    swing = math.exp(-damping * angle) * (math.cos(angle) + damping * math.sin(angle))
    return 1.0 - swing * (1.0 - quintic(max(passed - CALM, 0.0) / (1.0 - CALM)))


def restoration_time(nodes: np.ndarray, axis: tuple[np.ndarray, np.ndarray], gravity: float, zeta: float) -> float:
    """Time [s] from rest back to equilibrium, of a cable (n, 3) [m] that swings about the line through two points (3,) [m].

    Args:
        nodes: (n, 3) [m] In equilibrium.
        axis: Two points of the line; the same one twice for a cable held at one point.
        gravity: [m/s^2].
        zeta: Damping ratio.
    """
    along = axis[1] - axis[0]
    size = float(np.linalg.norm(along))
    arms = nodes - axis[0]
    if size > 0.0:
        arms = arms - np.outer(arms @ along / size**2, along)
    far = np.linalg.norm(arms, axis=1)
    rate = math.sqrt(gravity * float(far.sum()) / max(float((far * far).sum()), 1e-300))
    zeta = min(zeta, 0.9)
    return (0.5 * math.pi + math.asin(zeta)) / (rate * math.sqrt(1.0 - zeta * zeta))


def _estimated(stage: Stage, before: Stepped, after: Stepped, index: int, given: Relaxation) -> float:
    cable, shape = stage.scene.cables[index], after.cables[index].shape
    held = after.posture.positions[stage.holders(cable.name)]
    amplitude = farthest(before.cables[index].shape, shape)
    drag = 2.0 / (3.0 * math.pi) * AIR * DRAG * cable.diameter / max(cable.mass_per_length, 1e-9)
    gravity = max(float(np.linalg.norm(stage.scene.gravity)), 1e-3)
    once = restoration_time(shape.nodes, (held[0], held[-1]), gravity, drag * amplitude)
    return once if given.overshoot == 0.0 else 4.0 * PERIODS * once


def _moment(stage: Stage, before: Stepped, after: Stepped, time: float, passed: float, given: Relaxation) -> Moment:
    share = share_of_way(passed, given.overshoot)
    first, last = before.posture, after.posture
    posture = stage.between(first.time + min(share, 1.0) * (last.time - first.time), first.joints)
    stage.put(posture)
    cables = tuple(
        _on_the_way(stage, index, posture, was, now, share)
        for index, (was, now) in enumerate(zip(before.cables, after.cables, strict=True))
    )
    bill = msgspec.structs.replace(after.bill, solve=0.0, search=0.0, robot=0.0, encode=0.0, wire=0.0, wait=0.0, total=0.0)
    return Moment(time * passed, passed, Stepped(posture, cables, 0, stage.world.collisions(), bill))


def _on_the_way(stage: Stage, index: int, posture: Posture, was: Hanging, now: Hanging, share: float) -> Hanging:
    """A cable between two postures: no equilibrium, so without an error, contacts or a certificate."""
    first, last = was.shape, now.shape
    places = _places_before(was, now)
    middle = np.searchsorted(first.s, 0.5 * (places[1:] + places[:-1])) - 1
    shape = msgspec.structs.replace(
        last,
        s=(1.0 - share) * places + share * last.s,
        nodes=(1.0 - share) * points_at(first, places) + share * last.nodes,
        frames=blended(first.frames[middle], last.frames, share),
        contact_forces=np.zeros((0, 3)),
        contact_moments=np.zeros((0, 3)),
        contact_s=np.zeros(0),
        error=None,
        error_tension=None,
        error_curvature=None,
        sentence="on its way to the next equilibrium, an artificial motion",
        is_stable=False,
        margin=None,
        fold=None,
    )
    count, radius = stage.body_count, was.boundary.radius
    bodies = stage.touch_bodies.search(shape.nodes, posture.surfaces[:count], radius, radius)
    excluded = stage.excluded(stage.scene.cables[index].name, shape.s)
    links = stage.touch_links.search(shape.nodes, posture.surfaces[count:], radius, radius, excluded=excluded)
    return Hanging(shape, replace(now.boundary, pushes=NO_PUSHES), bodies, links)


def _places_before(was: Hanging, now: Hanging) -> np.ndarray:
    """Arc lengths (n,) [m] from which the nodes of the next equilibrium come: their own, or as far between the places that are touched.

    A cable without bending that runs over a body stays on it meanwhile: the node there is on it before and after, and so is the way.
    """
    s, first, last = now.shape.s, was.boundary.pushes, now.boundary.pushes
    if not was.boundary.is_limp:
        return s
    bodies = np.intersect1d(first.surface, last.surface)
    before, after = (np.array([pushes.s[pushes.surface == body].mean() for body in bodies]) for pushes in (first, last))
    order = np.argsort(after)
    if (np.diff(before[order]) <= 0.0).any():
        return s
    ends = s[[0, -1]]
    now_at, was_at = (np.hstack([ends[0], where[order], ends[1]]) for where in (after, before))
    places: np.ndarray = np.interp(s, now_at, was_at)
    return places
