"""Shapes that the programs are compared with, by `scipy.integrate.solve_bvp` to about 1e-12 of the length, and the catenary.

Of two hundred motions every twentieth has a reference; coarse shapes lead from one to the next. The spatial rod starts as the planar
one, whose far clamp is then turned to its yaw and its twist: this tells its branch, since clamps turned by +180 and -180 degrees are
one pose. All four sequences take 3.5 s together; `shape_server` certified their shapes stable.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from .collocation import Plane, Solved, Space, collocate
from .motions import LEVEL, MOTIONS, Hanging, Motions, Rod, far_frame

EVERY = 20  # motions
STRIDE = 5  # motions from one coarse shape to the next
COARSE = 1e-3  # relative residual of solve_bvp
FINE = 1e-8  # at 1e-9 instead, nodes move by 1.5e-12 of the length
MESH = np.linspace(0.0, 1.0, 101)
TURNS = 12  # in which the spatial rod's far clamp is turned
HEAVY = 1e3  # load number up to which collocation starts from the sag alone
SAG = 1.37  # rad, largest slope of a level cable of this span, to start from: J_0(1.37) = 0.58


def references(motions: Motions) -> dict[int, Solved]:
    """References by number of the motion; 0 is where the motions start, and where the last one ends."""
    shape = _start(motions)
    found = {0: _after(motions, 0, shape, FINE)}
    for motion in range(STRIDE, MOTIONS + 1, STRIDE):
        shape = _after(motions, motion, shape, COARSE)
        if motion % EVERY == 0:
            found[motion] = _after(motions, motion, shape, FINE)
    return found


def at_start(motions: Motions) -> Solved:
    """The reference where the motions start."""
    return _after(motions, 0, _start(motions), FINE)


def catenary(hanging: Hanging) -> np.ndarray:
    """(nodes, 3) [m] The cable that hangs as z = a cosh(x / a), with sinh(b) / b = length / span and a = span / 2 b."""
    b = brentq(lambda b: np.sinh(b) / b - hanging.length / hanging.span, 1e-3, 20.0, xtol=1e-15)
    a, s = hanging.span / (2 * b), hanging.s() - hanging.length / 2
    x = a * np.arcsinh(s / a) + hanging.span / 2
    return np.column_stack([x, np.zeros_like(s), np.hypot(a, s) - np.hypot(a, hanging.length / 2)])


def _after(motions: Motions, motion: int, before: Solved, tolerance: float) -> Solved:
    """The shape after a motion, from one close by."""
    kind = Plane if motions.is_planar else Space
    problem = kind.of(motions.rod, motions.position[motion], motions.quaternion[motion])
    found = collocate(problem, MESH, before.found.sol(MESH), before.found.p, tolerance, nodes_max=20_000)
    assert found.success, f"motion {motion} of {motions.name} to {tolerance:g}: {found.message}"
    return Solved(found, motions.rod)


def _start(motions: Motions) -> Solved:
    """The coarse shape where the motions start."""
    rod, position = motions.rod, motions.position[0]
    flat = level(rod, position)
    return flat if motions.is_planar else turned(rod, position, flat, np.linspace(0.0, 1.0, TURNS + 1))


def level(rod: Rod, position: np.ndarray) -> Solved:
    """The coarse shape in the plane between level clamps; a rod that is much softer than it is heavy is led there from a stiffer one.

    Raises:
        ArithmeticError: If collocation finds none.
    """
    slope = -SAG * np.sin(2 * np.pi * MESH)
    x, z = (np.append(0.0, np.cumsum((f[1:] + f[:-1]) / 2 * np.diff(MESH))) for f in (np.cos(slope), np.sin(slope)))
    problem = Plane.of(rod, position, np.array([LEVEL.as_quat()] * 2))
    mesh, states, force = MESH, np.array([x, z, slope, np.gradient(slope, MESH)]), np.array([0.0, -0.5])
    heavier = max(0, int(np.ceil(np.log10(problem.load / HEAVY))))
    for load in problem.load * 10.0 ** -np.arange(heavier, -1, -1):
        found = collocate(replace(problem, load=load), mesh, states, force * load, COARSE, nodes_max=5000)
        if not found.success:
            raise ArithmeticError(f"no start at a load of {load:.2g} EI / L^2: {found.message}")
        mesh, states, force = found.x, found.y, found.p / load
    return Solved(found, rod)


def turned(rod: Rod, position: np.ndarray, flat: Solved, parts: np.ndarray) -> Solved:
    """The level rod with its far clamp turned, in these parts, to the yaw and the twist of the spatial rod."""
    x, z, _, curvature = flat.found.sol(MESH)
    none = np.zeros_like(MESH)
    states = np.vstack([x, none, z, flat.frames(MESH * rod.length).T, none, -curvature, none])
    force = np.array([flat.found.p[0], 0.0, flat.found.p[1]])
    for part in parts:
        problem = Space.of(rod, position, np.array([LEVEL.as_quat(), far_frame(part).as_quat()]))
        found = collocate(problem, MESH, states, force, COARSE, nodes_max=5000)
        if not found.success:
            raise ArithmeticError(f"no start at {part:.2g} of the turn: {found.message}")
        states, force = found.sol(MESH), found.p
    return Solved(found, rod)
