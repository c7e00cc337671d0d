"""From one mesh to another: shapes carried over, compared, and combined to fourth order (Richardson extrapolation).

The error of a shape on n segments is c h^2 + O(h^4). On a mesh and on the one with every segment halved, r_h and r_h/2:

    error of r_h/2:  |r_h - r_h/2| / 3,        combined:  R = r_h/2 + (r_h/2 - r_h) / 3,  of fourth order,

and on three meshes the error of the last R is |R - R of the mesh before| / 15. Measured orders stand in
`tests/validation`. Where the observed differences do not fall by about four from mesh to mesh, a layer is not resolved yet, and the
whole difference is taken for the error. With contacts nothing is combined: what touches changes with the mesh.

Frames and tension are at the middles of segments, which are not those of the mesh before: there the finer mesh is taken between four
of its own, frames by their rotation vectors. Beside clamps the error has a term in h^3 that `half_cells` takes away first.

Wrenches at the grasps are combined in the same way, and so is the moment of the weight that they balance (`balance`).

Source: Richardson and Gaunt 1927, "The deferred approach to the limit".
"""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType
from typing import Final

import numpy as np

from .numpy_vertices import relative
from .reading import Reading
from .rod import State
from .system import System
from .task import Solution

SAFETY: Final = 1.3  # times the estimate, for the terms left out
LYING: Final = 2.0  # the same where a cable lies on something and touches down elsewhere on every mesh: the worst of 190 needed 1.8
RATIO_LEAST, RATIO_MOST = 2.5, 6.5  # between two differences; four is second order
FLOOR: Final = 2e-11  # of the length; rounding leaves no less


def transfer(path: ModuleType, finer: System, coarser: System, state: State) -> State:
    """The state of a rod carried over to another mesh: frames interpolated along s, forces kept."""
    there, here = _middles(coarser, state.frames), 0.5 * (finer.mesh.s[:-1] + finer.mesh.s[1:])
    moved = finer.start(path.interpolate_frames(*there, here))
    push, body = np.zeros(len(moved.push)), finer.body_rows
    fine, coarse = finer.rod.touch["contact"][:body], coarser.rod.touch["contact"][: coarser.body_rows]
    push[body:] = state.push[coarser.body_rows :]
    if len(fine) and len(coarse):
        total = np.bincount(coarse, weights=state.push[: len(coarse)], minlength=int(fine.max()) + 1)
        first = np.unique(fine, return_index=True)[1]
        push[first] = total[fine[first]]
    return moved._replace(
        force=state.force.copy(), holds=state.holds.copy(), push=push, touches=push > 0.0, drag=state.drag.copy(), sticks=state.sticks
    )


def _middles(system: System, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Arc lengths and frames of all segments, with the clamps at the ends of the cable among them."""
    mesh, rod = system.mesh, system.rod
    first, last = rod.clamp_of_node[0], rod.clamp_of_node[-1]
    before, after = int(first >= 0), int(last >= 0)
    s, all_frames = np.empty(len(frames) + before + after), np.empty((len(frames) + before + after, 4))
    s[before : before + len(frames)], all_frames[before : before + len(frames)] = 0.5 * (mesh.s[:-1] + mesh.s[1:]), frames
    if before:
        s[0], all_frames[0] = mesh.s[0], rod.clamp_frames[first]
    if after:
        s[-1], all_frames[-1] = mesh.s[-1], rod.clamp_frames[last]
    return s, all_frames


def apart(coarse: Solution, fine: Solution) -> float:
    """Largest distance [m] between the nodes that two meshes share; the coarser one's, if they share none but the ends."""
    s, own, nodes = fine.system.mesh.s, coarse.system.mesh.s, fine.found.seen.nodes
    shared = np.minimum(np.searchsorted(s, own - 1e-9 * s[-1]), len(s) - 1)
    if np.abs(s[shared] - own).max() > 1e-6 * s[-1]:
        at = np.column_stack([np.interp(own, s, column) for column in nodes.T])
    else:
        at = nodes[shared]
    away = at - coarse.found.seen.nodes
    return float(np.sqrt((away * away).sum(axis=1).max()))


def combined(coarse: Solution, fine: Solution) -> Reading:
    """The reading of fourth order, on the finer mesh, which has every segment of the coarser one halved."""
    first, second, path = coarse.mended, fine.mended, fine.task.path
    away = rotation_vectors(first.frames, _turned_to_middles(path, second.frames)) / 3
    return replace(
        second,
        nodes=second.nodes + _between((second.nodes[::2] - first.nodes) / 3),
        frames=path.retract(second.frames, _beside(away)),
        tension=second.tension + _beside((_to_middles(second.tension) - first.tension) / 3),
        curvature=np.maximum(second.curvature + _between_ends((second.curvature[::2] - first.curvature) / 3), 0.0),
        wrenches=second.wrenches + (second.wrenches - first.wrenches) / 3,
        energy=second.energy + (second.energy - first.energy) / 3,
        total_twist=second.total_twist + (second.total_twist - first.total_twist) / 3,
    )


def rotation_vectors(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Rotation vectors (k, 3) [rad] from frames to frames (k, 4), in the axes of the first."""
    turn = relative(before, after)
    size = np.linalg.norm(turn[:, :3], axis=1)
    share = np.where(size > 1e-12, 2 * np.arctan2(size, turn[:, 3]) / np.maximum(size, 1e-12), 2.0)
    return np.asarray(share[:, None] * turn[:, :3])


def _turned_to_middles(path: ModuleType, frames: np.ndarray) -> np.ndarray:
    """Frames (n, 4) of a mesh at the middles of every two segments, (n/2, 4): between the two, by their rotation vectors and the next."""
    own = frames[::2]
    place = np.arange(0, len(frames), 2)
    if len(frames) < 4:
        return np.asarray(path.retract(own, 0.5 * rotation_vectors(own, frames[1::2])))
    first = np.minimum(np.maximum(place - 1, 0), len(frames) - 4)
    turns = np.zeros((len(own), 3))
    for k in range(4):
        turns += _weights(place, first)[:, k, None] * rotation_vectors(own, frames[first + k])
    return np.asarray(path.retract(own, turns))


def _to_middles(values: np.ndarray) -> np.ndarray:
    """Values (n,) of a mesh at the middles of every two segments, (n/2,): cubic."""
    if len(values) < 4:
        return np.asarray(0.5 * (values[::2] + values[1::2]))
    place = np.arange(0, len(values), 2)
    first = np.minimum(np.maximum(place - 1, 0), len(values) - 4)
    return np.asarray((_weights(place, first) * values[first[:, None] + np.arange(4)]).sum(axis=1))


def _weights(place: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Weights (k, 4) of four middles of segments from `first` (k,) on, in the cubic at the node after segment `place` (k,)."""
    inner = np.array([-1.0, 9.0, 9.0, -1.0]) / 16
    before, after = np.array([5.0, 15.0, -5.0, 1.0]) / 16, np.array([1.0, -5.0, 15.0, 5.0]) / 16
    return np.where((place == first)[:, None], before, np.where((place == first + 2)[:, None], after, inner))


def _beside(values: np.ndarray) -> np.ndarray:
    """Values (n, ...) at the middles of segments, a quarter of a segment to both sides of there: (2n, ...), in straight lines."""
    out = np.empty((2 * len(values), *values.shape[1:]))
    slope = np.gradient(values, axis=0) if len(values) > 1 else np.zeros_like(values)
    out[::2], out[1::2] = values - 0.25 * slope, values + 0.25 * slope
    return out


def _between_ends(values: np.ndarray) -> np.ndarray:
    """The same (2n-1,), beside the ends without regard to the ends: at clamps curvature is that of the moment, more exact than beside."""
    out = _between(values)
    if len(values) >= 5:
        out[1] = (15 * values[1] - 10 * values[2] + 3 * values[3]) / 8
        out[-2] = (15 * values[-2] - 10 * values[-3] + 3 * values[-4]) / 8
    return out


def _between(values: np.ndarray) -> np.ndarray:
    """Values (n, ...) at the nodes of a mesh, cubic in between: (2n-1, ...)."""
    out = np.empty((2 * len(values) - 1, *values.shape[1:]))
    out[::2] = values
    if len(values) < 4:
        out[1::2] = 0.5 * (values[1:] + values[:-1])
        return out
    out[3:-3:2] = (9 * (values[1:-2] + values[2:-1]) - values[:-3] - values[3:]) / 16
    out[1] = (3 * values[0] + 6 * values[1] - values[2]) / 8
    out[-2] = (3 * values[-1] + 6 * values[-2] - values[-3]) / 8
    return out
