"""Random requests of which the exact answer is known: cables, grasps, contacts and tolerances, drawn from a seed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from protocol.cable import Cable
from protocol.kinds import Feature, Hold, Model
from protocol.messages import Contacts, Grasps, Problem, Shape
from protocol.scene import Vector

from . import boundary_value, floor
from .hanging import hanging

GRAVITY: Final = (0.0, 0.0, -9.81)
LEVEL: Final = Rotation.from_matrix([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])  # d1 up, d3 along x
ROWS: Final = 100  # places at which a cable may touch a floor

Points = Callable[[np.ndarray], np.ndarray]
Exact = Callable[[Shape], "Points | None"]


@dataclass(frozen=True)
class Draw:
    """A request and how to find the exact points (n, 3) [m] at arc lengths (n,) [m], of the branch that an answer is on."""

    kind: str
    problem: Problem
    gravity: Vector
    tolerance: float  # m
    exact: Exact


def draw(seed: int) -> Draw:
    """The request of a seed: of five, two rods in space, one in a plane, one on a floor, and a cable without bending."""
    rng = np.random.default_rng([20, seed])
    kinds = (_in_space, _in_space, _in_plane, _on_floor, _without_bending)
    return kinds[seed % len(kinds)](rng)


def _in_space(rng: np.random.Generator) -> Draw:
    cable = _cable(rng)
    place = Rotation.random(random_state=rng).apply([rng.uniform(0.15, 0.95) * cable.length, 0.0, 0.0])
    hold = ((Hold.CLAMP, Hold.CLAMP), (Hold.HINGE, Hold.CLAMP), (Hold.CLAMP, Hold.HINGE))[int(rng.choice(3, p=[0.6, 0.2, 0.2]))]
    frames = Rotation.random(2, random_state=rng).as_quat()
    return _rod("rod in space", cable, np.array([np.zeros(3), place]), frames, hold, rng)


def _in_plane(rng: np.random.Generator) -> Draw:
    cable = _cable(rng)
    distance, slope = rng.uniform(0.15, 0.95) * cable.length, rng.uniform(-1.2, 1.2)
    place = distance * np.array([math.cos(slope), 0.0, math.sin(slope)])
    frames = (Rotation.from_rotvec(np.outer(rng.uniform(-1.5, 1.5, 2), [0.0, -1.0, 0.0])) * LEVEL).as_quat()
    return _rod("rod in a plane", cable, np.array([np.zeros(3), place]), frames, (Hold.CLAMP, Hold.CLAMP), rng)


def _rod(kind: str, cable: Cable, places: np.ndarray, frames: np.ndarray, hold: tuple[Hold, Hold], rng: np.random.Generator) -> Draw:
    problem = Problem(cable=cable, grasps=Grasps(s=np.array([0.0, cable.length]), position=places, quaternion=frames, hold=hold))

    def exact(shape: Shape) -> Points | None:
        found = boundary_value.reference(problem, GRAVITY, shape)
        return None if found is None else found.nodes

    return Draw(kind, problem, GRAVITY, _tolerance(cable, rng), exact)


def _on_floor(rng: np.random.Generator) -> Draw:
    """Level clamps a little above a floor on which most of the cable lies."""
    length = 10 ** rng.uniform(-0.5, 0.7)
    weight = 10 ** rng.uniform(-1.0, 1.0)
    bending = weight * length**3 * 10 ** rng.uniform(-4.5, -2.7)
    problem, ends, height = lying_on_floor(length, weight, bending, length * rng.uniform(0.005, 0.03, 2), rng.uniform(0.3, 0.95))

    def exact(shape: Shape) -> Points | None:
        found = floor.lying(bending, weight, length, ends, height, shape)
        return None if found is None else found.nodes

    return Draw("rod on a floor", problem, GRAVITY, length * 10 ** rng.uniform(-4.5, -2.5), exact)


def lying_on_floor(length: float, weight: float, bending: float, rise: np.ndarray, share: float) -> tuple[Problem, np.ndarray, float]:
    """A rod between level clamps over a floor, on which most of it lies.

    For small slopes the part beside a clamp that is h above the lying part is lifted over a = (72 EI h / w)^(1/4), and takes 0.686 h^2 / a
    of slack if nothing pulls it; there is a `share` of that.

    Args:
        length: [m].
        weight: [N/m].
        bending: [N m^2] EI.
        rise: (2,) [m] How far the clamps are above the lying part.
        share: Of the slack; below one, so that the cable is pulled.

    Returns:
        The problem; x, z and slope of both clamps (2, 3) [m, m, rad]; height of the lying axis [m].
    """
    radius = 0.002 * length
    slack = share * 0.686 * float((rise**2 / (72.0 * bending * rise / weight) ** 0.25).sum())
    places = np.array([[0.0, 0.0, rise[0] + radius], [length - slack, 0.0, rise[1] + radius]])
    cable = Cable(name="lying", length=length, diameter=2 * radius, mass_per_length=weight / 9.81, bending=bending, twist=0.8 * bending)
    held = Grasps(s=np.array([0.0, length]), position=places, quaternion=np.array([LEVEL.as_quat()] * 2), hold=(Hold.CLAMP, Hold.CLAMP))
    problem = Problem(cable=cable, grasps=held, contacts=_plane(length, radius))
    return problem, np.column_stack([places[:, 0], places[:, 2], np.zeros(2)]), radius


def _without_bending(rng: np.random.Generator) -> Draw:
    length = 10 ** rng.uniform(-1.0, 1.5)
    cable = Cable(name="drawn", length=length, diameter=1e-3 * length, mass_per_length=10 ** rng.uniform(-2.0, 0.5))
    level, slope = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(-1.3, 1.3)
    place = (
        rng.uniform(0.1, 0.99) * length * np.array([math.cos(slope) * math.cos(level), math.cos(slope) * math.sin(level), math.sin(slope)])
    )
    held = Grasps(
        s=np.array([0.0, length]),
        position=np.array([np.zeros(3), place]),
        quaternion=np.array([LEVEL.as_quat()] * 2),
        hold=(Hold.HINGE, Hold.HINGE),
    )

    def exact(shape: Shape) -> Points | None:
        return lambda s: hanging(np.zeros(3), place, length, s)

    return Draw("catenary", Problem(cable=cable, grasps=held), GRAVITY, _tolerance(cable, rng), exact)


def _cable(rng: np.random.Generator) -> Cable:
    """A rod: EI over weight times length cubed from 3e-5 to 1, now and then with stretch, two stiffnesses, or bent when free."""
    length, weight = 10 ** rng.uniform(-1.0, 1.0), 10 ** rng.uniform(-1.0, 1.0)
    bending = weight * length**3 * 10 ** rng.uniform(-4.5, 0.0)
    stretches, is_flat, is_bent = rng.random(3) < (0.25, 0.25, 0.15)
    return Cable(
        name="drawn",
        length=length,
        diameter=1e-3 * length,
        mass_per_length=weight / 9.81,
        bending=bending,
        bending_2=float(rng.uniform(1.0, 4.0)) * bending if is_flat else None,
        twist=float(rng.uniform(0.4, 1.6)) * bending,
        stretch=weight * length * 10 ** rng.uniform(1.5, 4.0) if stretches else None,
        natural_curvature=tuple(rng.uniform(-2.0, 2.0, 3) / length) if is_bent else None,
    )


def _plane(length: float, radius: float) -> Contacts:
    """A floor through the origin, for `ROWS` places of the cable."""
    s = (np.arange(ROWS) + 0.5) / ROWS * length
    none = np.zeros((ROWS, 3))
    return Contacts(
        s=s,
        body=np.zeros(ROWS, dtype=np.int64),
        feature=np.full(ROWS, int(Feature.FACE)),
        point=np.column_stack([s, none[:, 1:]]),
        normal=np.tile([0.0, 0.0, 1.0], (ROWS, 1)),
        direction=none,
        extent=np.zeros((ROWS, 2)),
        distance=np.full(ROWS, radius),
        friction=np.zeros(ROWS, dtype=np.int64),
        force=none,
    )


def _tolerance(cable: Cable, rng: np.random.Generator) -> float:
    """From a millionth of the length to three thousandths."""
    return float(cable.length * 10 ** rng.uniform(-6.0, -2.5))


def true_error(shape: Shape, exact: Points) -> float:
    """Largest distance [m] of a shape from the exact one: of its nodes from the points at their arc lengths.

    Where the model promises the whole polyline, also of the middle of every segment's arc from its chord, square to it.
    """
    if shape.model == Model.CATENARY.value:
        return polyline_error(shape.s, shape.nodes, exact)
    return float(np.linalg.norm(exact(shape.s) - shape.nodes, axis=1).max())


def polyline_error(s: np.ndarray, nodes: np.ndarray, exact: Points) -> float:
    """Largest distance [m] from the exact shape, of nodes (n, 3) [m] at s (n,) [m] and of the middle of each arc from its chord."""
    chord = np.diff(nodes, axis=0)
    bulge = exact(0.5 * (s[1:] + s[:-1])) - 0.5 * (nodes[1:] + nodes[:-1])
    along = np.einsum("ij,ij->i", bulge, chord) / np.einsum("ij,ij->i", chord, chord)
    return float(max(np.linalg.norm(part, axis=1).max() for part in (exact(s) - nodes, bulge - along[:, None] * chord)))
