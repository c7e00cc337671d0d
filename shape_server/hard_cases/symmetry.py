"""Symmetry: random problems turned, moved, mirrored, measured in other units, named from the other end; only that may change.

The clamps lie at 0.3 to 0.9 of the length from each other with frames of all directions, so that twist and all three dimensions matter.
Where several shapes are stable the start decides, so each changed problem starts from the changed shape, and must stay there; solved
cold, it must find a shape as good: of the same energy, or another that is in balance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from types import ModuleType
from typing import Final

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from protocol.hard_case import Case, Check
from protocol.kinds import Model
from protocol.messages import Grasps, Problem, Start
from protocol.scene import Vector

from .answers import found
from .balance import balance
from .posing import GRAVITY, cable, grasps

FAMILY: Final = "symmetry"
SEEDS: Final = range(8)
MILLIMETRES: Final = 1000.0


@dataclass(frozen=True)
class Image:
    """What a symmetry makes of a problem: of points (n, 3), frames (n, 4) and forces; whether the cable runs the other way."""

    points: Callable[[np.ndarray], np.ndarray]
    frames: Callable[[np.ndarray], np.ndarray]
    forces: Callable[[np.ndarray], np.ndarray]
    gravity: Vector = GRAVITY
    length: float = 1.0
    stiffness: float = 1.0
    mass: float = 1.0
    is_reversed: bool = False


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for seed in SEEDS:
        for name in ("turned", "moved", "mirrored", "in millimetres", "in pounds", "from the other end", "rolled"):
            yield Case(f"random problem {seed}, {name}", FAMILY, partial(_changed, seed, name, True))
        yield Case(f"random problem {seed}, turned, cold", FAMILY, partial(_changed, seed, "turned", False))
        yield Case(f"random problem {seed}, mirrored, cold", FAMILY, partial(_changed, seed, "mirrored", False))


def _image(name: str, seed: int) -> Image:
    rng = np.random.default_rng(1000 + seed)
    if name == "turned":
        turn = Rotation.random(random_state=rng)
        gravity = turn.apply(GRAVITY).tolist()
        return Image(turn.apply, lambda q: (turn * Rotation.from_quat(q)).as_quat(), turn.apply, (gravity[0], gravity[1], gravity[2]))
    if name == "moved":
        by = 100.0 * rng.normal(size=3)
        return Image(lambda x: x + by, _same, _same)
    if name == "mirrored":
        return Image(_mirror, _mirror_frames, _mirror)
    if name == "in millimetres":  # lengths in mm, forces as they are: EI in N mm^2, weight in N/mm by g in mm/s^2 and mass in t/mm
        return Image(_in_millimetres, _same, _same, (0.0, 0.0, -9810.0), MILLIMETRES, MILLIMETRES**2, 1 / MILLIMETRES**2)
    if name == "in pounds":
        return Image(_same, _same, lambda f: 4.448 * f, stiffness=4.448, mass=4.448)
    if name == "rolled":
        roll = Rotation.from_rotvec([0.0, 0.0, float(rng.uniform(-3, 3))])
        return Image(_same, lambda q: (Rotation.from_quat(q) * roll).as_quat(), _same)
    about = Rotation.from_rotvec([np.pi, 0.0, 0.0])  # d3 and d2 turn over, d1 stays
    return Image(_same, lambda q: (Rotation.from_quat(q[::-1]) * about).as_quat(), _same, is_reversed=True)


def _same(value: np.ndarray) -> np.ndarray:
    return value


def _in_millimetres(value: np.ndarray) -> np.ndarray:
    return value * MILLIMETRES


def _mirror(value: np.ndarray) -> np.ndarray:
    """In the plane x-z."""
    return value * (1.0, -1.0, 1.0)


def _mirror_frames(value: np.ndarray) -> np.ndarray:
    """Tangent and d1 are mirrored; d2 is what makes the frame right-handed again."""
    matrices = Rotation.from_quat(value).as_matrix()
    image = matrices * np.array([1.0, -1.0, 1.0])[:, None] * np.array([1.0, -1.0, 1.0])
    return np.asarray(Rotation.from_matrix(image).as_quat())


def _random(seed: int) -> Problem:
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=3)
    end = rng.uniform(0.3, 0.9) * direction / np.linalg.norm(direction)
    first, last = Rotation.random(2, random_state=rng).as_quat()
    held = grasps((0.0, (0.0, 0.0, 0.0), first), (1.0, end, last))
    return Problem(cable=cable(bending=float(10 ** rng.uniform(-3, -1))), grasps=held, model=Model.ROD)


def _of(problem: Problem, image: Image) -> Problem:
    rod, held = problem.cable, problem.grasps
    assert rod.bending is not None
    assert rod.twist is not None
    size, stiffness = image.length, image.stiffness
    changed = replace(
        rod,
        length=size * rod.length,
        diameter=size * rod.diameter,
        bending=stiffness * rod.bending,
        twist=stiffness * rod.twist,
        mass_per_length=image.mass * rod.mass_per_length,
    )
    order = slice(None, None, -1) if image.is_reversed else slice(None)
    s = size * (1.0 - held.s[::-1] if image.is_reversed else held.s)
    ends = Grasps(
        s=s,
        position=np.ascontiguousarray(image.points(held.position)[order]),
        quaternion=np.ascontiguousarray(image.frames(held.quaternion)),
        hold=held.hold,
    )
    return msgspec.structs.replace(problem, cable=changed, grasps=ends)


def _changed(seed: int, name: str, is_warm: bool, path: ModuleType) -> Iterable[Check]:
    problem, image = _random(seed), _image(name, seed)
    shape = found(problem, GRAVITY, path, extrapolate=False)
    other, size = _of(problem, image), image.length
    order = slice(None, None, -1) if image.is_reversed else slice(None)
    if is_warm:
        start = Start(
            s=size * (1.0 - shape.s[::-1] if image.is_reversed else shape.s),
            frames=np.ascontiguousarray(image.frames(shape.frames)),
            grasp_forces=np.ascontiguousarray(image.forces(shape.grasp_wrenches[:, :3])[order]),
        )
        other = msgspec.structs.replace(other, start=start)
    seen = found(other, image.gravity, path, tolerance=1e-3 * size, extrapolate=False)
    yield from balance(other, seen, image.gravity)
    off = np.inf
    if len(seen.s) == len(shape.s):
        off = float(np.linalg.norm(seen.nodes - image.points(shape.nodes)[order], axis=1).max()) / size
    if is_warm:
        yield Check("place of a node", off, 1e-7, "of the length")
        force = seen.grasp_wrenches[:, :3] - image.forces(shape.grasp_wrenches[:, :3])[order]
        yield Check("force at a grasp", float(np.abs(force).max() / np.abs(seen.grasp_wrenches[:, :3]).max()), 1e-6, "of it")
    elif off < 1e-2:
        yield Check("place of a node, cold", off, 1e-4, "of the length")
