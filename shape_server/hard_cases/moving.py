"""Grippers on their way: a thousand small steps against one jump, steps of a nanometre, shaking, there and back, on one mesh and on two."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from types import ModuleType
from typing import Final

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from protocol.hard_case import Case, Check
from protocol.kinds import Model
from protocol.messages import Problem, Shape, Start

from .answers import found
from .balance import balance
from .posing import ALONG_X, GRAVITY, apart, cable, going_on, grasps, place

FAMILY: Final = "moving"
Posture = tuple[np.ndarray, np.ndarray]  # position (3,) [m] and turning vector (3,) [rad] of the last grasp
BEGIN: Final[Posture] = (np.array([0.6, 0.0, 0.0]), np.zeros(3))
WAYS: Final[dict[str, Posture]] = {
    "nearer": (np.array([0.3, 0.0, 0.0]), np.zeros(3)),
    "further": (np.array([0.95, 0.0, 0.0]), np.zeros(3)),
    "aside and up": (np.array([0.5, 0.3, 0.2]), np.zeros(3)),
    "turned": (np.array([0.6, 0.1, 0.0]), np.array([0.3, -0.5, 0.9])),
    "lowered and rolled": (np.array([0.5, 0.0, -0.4]), np.array([1.0, 0.0, 0.0])),
}


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for name in WAYS:
        yield Case(f"{name}: a thousand steps against one jump", FAMILY, partial(_steps_or_jump, name, 1000), is_slow=True)
        yield Case(f"{name}: a hundred steps against one jump", FAMILY, partial(_steps_or_jump, name, 100))
        yield Case(f"{name}: there and back in forty steps", FAMILY, partial(_there_and_back, name))
        yield Case(f"{name}: twice the nodes", FAMILY, partial(_twice_the_nodes, name))
        yield Case(f"{name}: fifty steps of a nanometre", FAMILY, partial(_nanometres, name))
        yield Case(f"{name}: a jump, cold and warm", FAMILY, partial(_cold_and_warm, name))
    for size in (1e-9, 1e-6, 1e-3, 1e-2):
        yield Case(f"gripper that shakes by {size:g} m", FAMILY, partial(_shaking, size))
    for bending in (1e-4, 1e-3, 1e-1):
        yield Case(f"the same request a hundred times, EI {bending:g}", FAMILY, partial(_again_and_again, bending))


def _problem(posture: Posture, bending: float = 1e-2) -> Problem:
    position, turn = posture
    last = (Rotation.from_rotvec(turn) * Rotation.from_quat(ALONG_X)).as_quat()
    held = grasps((0.0, (0.0, 0.0, 0.0), ALONG_X), (1.0, position, last))
    return Problem(cable=cable(bending=bending), grasps=held, model=Model.ROD)


def _on_mesh(path: ModuleType, posture: Posture, count: int, bending: float = 1e-2) -> Shape:
    """The shape found cold, settled on an even mesh."""
    problem = _problem(posture, bending)
    free = found(problem, GRAVITY, path)
    s = np.linspace(0.0, 1.0, count + 1)
    nearest = np.clip(np.searchsorted(free.s, (s[1:] + s[:-1]) / 2) - 1, 0, len(free.frames) - 1)
    start = Start(s=s, frames=free.frames[nearest], grasp_forces=free.grasp_wrenches[:, :3].copy())
    return found(msgspec.structs.replace(problem, start=start), GRAVITY, path, extrapolate=False)


def _between(name: str, share: float) -> Posture:
    position, turn = WAYS[name]
    return (1 - share) * BEGIN[0] + share * position, share * turn


def _walk(shape: Shape, name: str, shares: np.ndarray, path: ModuleType) -> Shape:
    for share in shares:
        shape = found(going_on(_problem(_between(name, float(share))), shape), GRAVITY, path, extrapolate=False)
    return shape


def _steps_or_jump(name: str, steps: int, path: ModuleType) -> Iterable[Check]:
    """The end of the way is one shape, unless two are stable there: then both are in balance, and that is all that can be asked."""
    begin = _on_mesh(path, BEGIN, 40)
    stepped = _walk(begin, name, np.linspace(0.0, 1.0, steps + 1)[1:], path)
    jumped = _walk(begin, name, np.ones(1), path)
    problem = _problem(WAYS[name])
    for shape in (stepped, jumped):
        yield from balance(problem, shape, GRAVITY)
    off = apart(stepped, jumped)
    if off < 1e-2:
        yield Check("place of a node, stepped and jumped", off, 1e-6)


def _there_and_back(name: str, path: ModuleType) -> Iterable[Check]:
    begin = _on_mesh(path, BEGIN, 40)
    shares = np.concatenate([np.linspace(0.0, 1.0, 41)[1:], np.linspace(1.0, 0.0, 41)[1:]])
    end = _walk(begin, name, shares, path)
    yield Check("place of a node after the way back", apart(end, begin), 1e-6)
    yield Check("twist after the way back", abs(end.total_twist - begin.total_twist), 1e-5, "rad")


def _twice_the_nodes(name: str, path: ModuleType) -> Iterable[Check]:
    """Second order: 80 segments against 160, and 160 against 320, differ by four to one."""
    shapes = [_on_mesh(path, WAYS[name], count) for count in (80, 160, 320)]
    coarse = float(np.linalg.norm(shapes[0].nodes - place(shapes[1], shapes[0].s), axis=1).max())
    fine = float(np.linalg.norm(shapes[1].nodes - place(shapes[2], shapes[1].s), axis=1).max())
    yield Check("80 segments against 160", coarse, 1e-3)
    yield Check("160 segments against 320", fine, coarse / 3 + 1e-7)


def _nanometres(name: str, path: ModuleType) -> Iterable[Check]:
    """Fifty steps of a nanometre move nothing by more than their sum lets them, and no step moves much more than another."""
    begin = _on_mesh(path, BEGIN, 40)
    way = float(np.linalg.norm(WAYS[name][0] - BEGIN[0]) + np.linalg.norm(WAYS[name][1]))
    shape, moved = begin, []
    for k in range(1, 51):
        last, shape = shape, _walk(shape, name, np.array([k * 1e-9 / way]), path)
        moved.append(float(np.linalg.norm(shape.nodes - last.nodes, axis=1).max()))
    yield Check("largest move of a node in a step", max(moved), 2e-8)
    yield Check("all moves together", apart(shape, begin), 2.5e-7)


def _shaking(size: float, path: ModuleType) -> Iterable[Check]:
    """A hundred random places about one, and back at it."""
    begin = shape = _on_mesh(path, BEGIN, 40)
    rng = np.random.default_rng(7)
    for _ in range(100):
        posture = (BEGIN[0] + size * rng.normal(size=3), size * rng.normal(size=3))
        shape = found(going_on(_problem(posture), shape), GRAVITY, path, extrapolate=False)
    shape = found(going_on(_problem(BEGIN), shape), GRAVITY, path, extrapolate=False)
    yield Check("place of a node after the shaking", apart(shape, begin), 1e-7)
    yield Check("twist after the shaking", abs(shape.total_twist - begin.total_twist), 1e-6, "rad")


def _again_and_again(bending: float, path: ModuleType) -> Iterable[Check]:
    begin = shape = _on_mesh(path, BEGIN, 40, bending)
    for _ in range(100):
        shape = found(going_on(_problem(BEGIN, bending), shape), GRAVITY, path, extrapolate=False)
    yield Check("creep of a node", apart(shape, begin), 1e-7)


def _cold_and_warm(name: str, path: ModuleType) -> Iterable[Check]:
    """One shape, or two that are both stable and in balance."""
    warm, cold = _walk(_on_mesh(path, BEGIN, 80), name, np.ones(1), path), _on_mesh(path, WAYS[name], 80)
    off = apart(warm, cold)
    if off < 1e-2:
        yield Check("place of a node, cold and warm", off, 1e-6)
    yield from balance(_problem(WAYS[name]), warm, GRAVITY)
