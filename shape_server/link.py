"""Whole turns that a cable has shed by passing through itself, and how many a straight cable bears.

Twist and writhe of a cable between two clamps may change into each other, as where it winds up into a helix or a loop; their sum, the
link, changes only where the cable passes through itself (or beyond its clamps), by two turns each time. Contact of the cable with itself is
not built, so a descent can go that way, and comes to a shape that has other turns than were asked for.

The writhe of a polygon is the sum over all pairs of its edges of the solid angle under which they are seen to cross, over 2 pi.

Source: Calugareanu 1959 and White 1969 (link = twist + writhe); Klenin and Langowski 2000, "Computation of writhe in modeling of
supercoiled DNA", Biopolymers 54, 307-317, method 1a; Greenhill 1883, "On the strength of shafting", for the straight rod; its clamped ends
after Timoshenko and Gere 1961, "Theory of elastic stability", 2nd ed., sec. 2.21.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from protocol.kinds import Hold
from protocol.messages import Problem

from .equilibrium import Settled
from .numpy_path import directors
from .rod import State
from .system import System
from .task import Task

FAR: Final = 10.0  # lengths of the cable, to where both ends are led on along their tangents and joined
STRAIGHT: Final = 1e-6  # rad, between clamps and chord
LEAST_PULL: Final = 1e-3  # of EI over length squared; without any the closed form is 0 / 0


def shed(task: Task, system: System, asked: State, found: Settled) -> int:
    """Whole turns that a shape has less than the start curve, whose turns were asked for.

    They are even, as each crossing is worth two, but for a curve that turns by half a turn or more between two segments: that is told too.
    """
    _, curve = task.path.look(system.rod, asked, np.ascontiguousarray(system.rod.touch["normal"]))
    twist = system.twist(task.path, asked.frames) - system.twist(task.path, found.state.frames)
    ends = curve.axes[0, 2], curve.axes[-1, 2]
    writhes = [writhe(_closed(nodes, *ends)) for nodes in (curve.nodes, found.seen.nodes)]
    return round(twist / (2 * np.pi) + writhes[0] - writhes[1])


def writhe(nodes: np.ndarray) -> float:
    """Writhe in turns of the closed polygon through nodes (n, 3), the last joined to the first."""
    following = np.roll(nodes, -1, axis=0)
    i, j = np.triu_indices(len(nodes), 2)
    a, b, c, d = nodes[i], following[i], nodes[j], following[j]
    sides = [np.cross(c - a, d - a), np.cross(d - a, d - b), np.cross(d - b, c - b), np.cross(c - b, c - a)]
    sides = [side / np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-300) for side in sides]
    angle = sum(np.arcsin(np.clip((sides[k] * sides[(k + 1) % 4]).sum(axis=1), -1.0, 1.0)) for k in range(4))
    sign = np.sign((np.cross(d - c, b - a) * (c - a)).sum(axis=1))
    return float((angle * sign).sum() / (2 * np.pi))


def _closed(nodes: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """A curve (n, 3) led on far along the tangents of its ends, where any chord joins them beside the cable."""
    far = FAR * np.linalg.norm(np.diff(nodes, axis=0), axis=1).sum()
    aside = np.cross(last + first, np.eye(3)[int(np.argmin(np.abs(last + first)))])
    apex = far * (aside / np.linalg.norm(aside) if aside.any() else np.eye(3)[2])
    return np.vstack([nodes[0] - far * first, nodes, nodes[-1] + far * last, nodes[0] + apex])


def advice(problem: Problem) -> str:
    """What to say of the turns of twist that a problem asks for, when no shape with them was found."""
    borne = turns_borne(problem)
    straight = "" if borne is None else f"; straight and without its weight the cable bears {borne:.3g} turns before it buckles"
    more = "ask for fewer" if borne is None else "ask for fewer, or pull harder"
    return f"{sum(problem.turns)} whole turns of twist were asked for{straight}; {more}"


def turns_borne(problem: Problem) -> float | None:
    """Turns of twist under which a straight, pulled cable between two clamps buckles; None if it is none, or not uniform.

    A bow w = x + i y obeys EI w_ssss - i M w_sss - T w_ss = 0 between clamps, where the pull T counts as many times as the cable is longer
    than its arc length L, over which it turns the tangent. With a = M L / 2 EI and b^2 = a^2 - T L^2 / EI it is
    c0 + i c1 s + exp(i a s) (p cos b s + i q sin b s), s from the middle over the length, which is zero with its slope at both ends for the
    least b at which `_closing` is zero. Without a pull M = 8.987 EI / L.
    """
    cable, grasps = problem.cable, problem.grasps
    if cable.stretch is None or cable.bending is None or not cable.twist or grasps.hold != (Hold.CLAMP, Hold.CLAMP):
        return None
    if cable.bending_2 is not None or cable.natural_curvature is not None or cable.sections or problem.loads is not None or cable.masses:
        return None
    chord = grasps.position[1] - grasps.position[0]
    size, span = float(np.linalg.norm(chord)), float(grasps.s[1] - grasps.s[0])
    tangents = directors(grasps.quaternion)[:, 2]
    if size < span or np.linalg.norm(np.cross(tangents, chord / size), axis=1).max() > STRAIGHT or (tangents @ chord).min() < 0.0:
        return None
    pull = max(cable.stretch * (size / span - 1.0) * size * span / cable.bending, LEAST_PULL)
    from scipy.optimize import brentq  # here: 0.2 s that others do without

    places = np.linspace(0.05, 2 * np.pi, 400)
    signs = np.sign([_closing(at, pull) for at in places])
    first = int(np.flatnonzero(signs[1:] != signs[:-1])[0])
    least = brentq(_closing, places[first], places[first + 1], args=(pull,))
    return float(np.sqrt(pull + least**2) * cable.bending / (np.pi * cable.twist))


def _closing(b: float, pull: float) -> float:
    """Zero where a bow between clamps exists, see `turns_borne`; `pull` is T L^2 / EI."""
    a = np.sqrt(pull + b * b)
    sine, cosine, s, c = np.sin(a / 2), np.cos(a / 2), np.sin(b / 2), np.cos(b / 2)
    first = (b * cosine * s + a * sine * c) * (-2 * cosine * s - a * sine * s + b * cosine * c)
    second = (a * cosine * s + b * sine * c) * (-2 * sine * c - b * sine * s + a * cosine * c)
    return float(first - second)
