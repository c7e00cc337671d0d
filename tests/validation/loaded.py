"""Problems with loads, masses, sections, guides and turns, and the balance of their answers."""

from __future__ import annotations

import numpy as np
from posed import G, on_nodes

import shape_server.kernels as compiled
from protocol.cable import Cable
from protocol.messages import Grasps, PointLoads, Problem, Shape, Start
from shape_server import solve


def pose(
    cable: Cable, grasps: Grasps, *forces: tuple[float, tuple[float, float, float]], start: Start | None = None, turns: tuple[int, ...] = ()
) -> Problem:
    """A problem with forces [N] at arc lengths [m]."""
    loads = None
    if forces:
        loads = PointLoads(s=np.array([row[0] for row in forces]), force=np.array([row[1] for row in forces], dtype=float))
    return Problem(cable=cable, grasps=grasps, loads=loads, start=start, turns=turns)


def answer(problem: Problem, *, tolerance: float = 1e-6, extrapolate: bool = True, margin: bool = False) -> Shape:
    """Solve with the compiled kernels under gravity along -z; `tolerance` in metres."""
    return solve(problem, (0.0, 0.0, -G), tolerance=tolerance, extrapolate=extrapolate, margin=margin, path=compiled)


def straight(length: float, segments: int, quaternion: np.ndarray, forces: np.ndarray) -> Start:
    """Start as a straight cable with one frame, held by `forces`, (g, 3) [N]."""
    s = np.linspace(0.0, length, segments + 1)
    return Start(s=s, frames=np.tile(quaternion, (segments, 1)), grasp_forces=np.asarray(forces, dtype=float))


def place(shape: Shape, s: float | np.ndarray) -> np.ndarray:
    """(..., 3) [m] Position at arc length s, between nodes on the polygon."""
    return np.stack([np.interp(s, shape.s, row) for row in shape.nodes.T], axis=-1)


def linear_density(cable: Cable, s: np.ndarray) -> np.ndarray:
    """[kg/m] Mass per length at s."""
    density = np.full_like(s, cable.mass_per_length)
    for part in cable.sections:
        if part.mass_per_length is not None:
            density[(part.start < s) & (s < part.end)] = part.mass_per_length
    return density


def unbalanced(problem: Problem, shape: Shape) -> tuple[float, float]:
    """Sum of all forces, and of their moments about the origin, over the largest force and that times length.

    A rod that carries nothing is measured by EI / L^2. Weight acts as `on_nodes` says, masses and point loads where the answer puts
    them, a grasp where the answer puts its arc length.
    """
    rod, middle = problem.cable, (shape.s[1:] + shape.s[:-1]) / 2
    down = np.array([0.0, 0.0, -G])
    rows = [
        (shape.nodes, on_nodes(shape, linear_density(rod, middle) * np.diff(shape.s), problem.grasps)[:, None] * down),
        (place(shape, problem.grasps.s), shape.grasp_wrenches[:, :3]),
    ]
    if rod.masses:
        rows.append(
            (place(shape, np.array([mass.at for mass in rod.masses])), np.array([mass.mass for mass in rod.masses])[:, None] * down)
        )
    if problem.loads is not None:
        rows.append((place(shape, problem.loads.s), problem.loads.force))
    points, forces = (np.concatenate(column) for column in zip(*rows, strict=True))
    largest = float(np.linalg.norm(forces, axis=1).max())
    weight = float(np.linalg.norm(rows[0][1].sum(0)))
    scale = max(largest, weight, (rod.bending or 0.0) / rod.length**2)
    moment = np.cross(points, forces).sum(0) + shape.grasp_wrenches[:, 3:].sum(0)
    return float(np.linalg.norm(forces.sum(0)) / scale), float(np.linalg.norm(moment) / scale / rod.length)
