"""Where a robot's links are, and which joint positions bring a hand to a pose: compiled kernels on arrays, float64.

A row of a chain is (origin rotation (9), origin position (3), axis (3), kind (1)): a joint's frame in its parent's, the joint's
axis in its own frame, and 0 fixed, 1 turning, 2 sliding. For row i at joint position q_i

    R_i = R_(i-1) O_i rot(a_i, q_i),    p_i = p_(i-1) + R_(i-1) (o_i + slide a_i)

and the geometric Jacobian of a tip at p has columns (w x (p - p_i), w) for turning and (w, 0) for sliding joints, w = a_i in the
world. Positions agree with an exact evaluation to rounding (1e-15 m); PyBullet's getLinkState is rounded to float32, so grasp
poses must not come from there.

Inverse kinematics is Levenberg-Marquardt on e = (x_d - x, log(R_d R^T)) with the smallest step in the joints,
dq = J^T (J J^T + lambda 1)^-1 e. A joint that the step would push through its limit is set on the limit, its share is taken
from e, and the rest is solved again; so limits hold at every iterate.

A redundant arm that always takes the smallest step drifts onto its limits. So the first step of a solution also moves inwards by
z_k = -|dq| u_k^3, where u_k goes from -1 to 1 over the joint's range, and the rest makes up for it: dq = z + J^T (...)^-1 (e - J z). The
hand ends at the same pose, and an arm whose hand rests stays where it is.

Source: Nakamura and Hanafusa 1986, "Inverse kinematic solutions with singularity robustness" (damping); Levenberg 1944.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numba import njit

FIXED, TURNING, SLIDING = 0, 1, 2
ROW: Final = 16  # numbers in a row of a chain
LAMBDA_START: Final = 1e-4
LAMBDA_LEAST: Final = 1e-14
ERROR_DONE: Final = 1e-12  # m and rad; rounding leaves 1e-15


@njit(cache=True)
def advance(row: np.ndarray, position: float, rotation: np.ndarray, origin: np.ndarray, frame: np.ndarray) -> None:
    """Write into `frame` (4, 3) the child of the frame (`rotation`, `origin`): rows 0-2 its rotation, row 3 its position.

    Rodrigues: rot(a, q) = cos q 1 + sin q [a] + (1 - cos q) a a^T. `frame` must be another array than its parent's.
    """
    x, y, z = row[12], row[13], row[14]
    slide = position if row[15] == SLIDING else 0.0
    for i in range(3):
        frame[3, i] = origin[i]
        for j in range(3):
            frame[i, j] = rotation[i, 0] * row[j] + rotation[i, 1] * row[3 + j] + rotation[i, 2] * row[6 + j]
            frame[3, i] += rotation[i, j] * row[9 + j]
    if row[15] == SLIDING:
        for i in range(3):
            frame[3, i] += slide * (frame[i, 0] * x + frame[i, 1] * y + frame[i, 2] * z)
    if row[15] == TURNING:
        c, s = math.cos(position), math.sin(position)
        v = 1.0 - c
        for i in range(3):
            a, b, d = frame[i, 0], frame[i, 1], frame[i, 2]
            frame[i, 0] = a * (c + v * x * x) + b * (v * x * y + s * z) + d * (v * x * z - s * y)
            frame[i, 1] = a * (v * x * y - s * z) + b * (c + v * y * y) + d * (v * y * z + s * x)
            frame[i, 2] = a * (v * x * z + s * y) + b * (v * y * z - s * x) + d * (c + v * z * z)


@njit(cache=True)
def tree_frames(parents: np.ndarray, rows: np.ndarray, columns: np.ndarray, base: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """Frames of all links of a tree, (L, 4, 3): rotation in rows 0-2, position in row 3; link 0 is the base.

    Args:
        parents: (L,) int, index of each link's parent, which comes before it.
        rows: (L, 16) Joint that carries each link.
        columns: (L,) int, which of `joints` moves the link; -1 for none.
        base: (4, 3) Frame of link 0 in the world.
        joints: (j,) [rad or m]
    """
    frames = np.empty((len(parents), 4, 3))
    frames[0] = base
    for link in range(1, len(parents)):
        parent = frames[parents[link]]
        position = joints[columns[link]] if columns[link] >= 0 else 0.0
        advance(rows[link], position, parent[:3], parent[3], frames[link])
    return frames


@njit(cache=True)
def poses_of(frames: np.ndarray) -> np.ndarray:
    """Frames (L, 4, 3) as positions and quaternions (L, 7), (x, y, z, w); w >= 0 up to ties."""
    poses = np.empty((len(frames), 7))
    for link in range(len(frames)):
        frame = frames[link]
        # Four times the squared components; the largest is at least 1, so its root is safe to divide by (Shepperd 1978).
        trace = frame[0, 0] + frame[1, 1] + frame[2, 2]
        squares = (
            1.0 + 2.0 * frame[0, 0] - trace,
            1.0 + 2.0 * frame[1, 1] - trace,
            1.0 + 2.0 * frame[2, 2] - trace,
            1.0 + trace,
        )
        best = 3
        for i in range(3):
            if squares[i] > squares[best]:
                best = i
        twice = math.sqrt(squares[best])
        quaternion = np.empty(4)
        quaternion[best] = 0.5 * twice
        if best == 3:
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                quaternion[i] = 0.5 * (frame[k, j] - frame[j, k]) / twice
        else:
            j, k = (best + 1) % 3, (best + 2) % 3
            quaternion[j] = 0.5 * (frame[j, best] + frame[best, j]) / twice
            quaternion[k] = 0.5 * (frame[k, best] + frame[best, k]) / twice
            quaternion[3] = 0.5 * (frame[k, j] - frame[j, k]) / twice
        sign = -1.0 if quaternion[3] < 0.0 else 1.0
        poses[link, :3] = frame[3]
        poses[link, 3:] = sign * quaternion
    return poses


@njit(cache=True)
def chain_frame(chain: np.ndarray, joints: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
    """Frame (4, 3) of a chain's tip in the world; fills `jacobian` (6, n), rows of velocity then of angular velocity.

    Args:
        chain: (n+1, 16) Joints from the world to the tip, the last row fixed (the tip in the last joint's frame).
        joints: (n,) [rad or m]
        jacobian: (6, n) Overwritten.
    """
    count = len(joints)
    frames = np.empty((count + 2, 4, 3))
    frames[0] = 0.0
    for i in range(3):
        frames[0, i, i] = 1.0
    for joint in range(count + 1):
        position = joints[joint] if joint < count else 0.0
        advance(chain[joint], position, frames[joint, :3], frames[joint, 3], frames[joint + 1])
    tip = frames[count + 1]
    for joint in range(count):
        frame, row = frames[joint + 1], chain[joint]
        wx = frame[0, 0] * row[12] + frame[0, 1] * row[13] + frame[0, 2] * row[14]
        wy = frame[1, 0] * row[12] + frame[1, 1] * row[13] + frame[1, 2] * row[14]
        wz = frame[2, 0] * row[12] + frame[2, 1] * row[13] + frame[2, 2] * row[14]
        if row[15] == SLIDING:
            jacobian[0, joint], jacobian[1, joint], jacobian[2, joint] = wx, wy, wz
            jacobian[3:, joint] = 0.0
        else:
            rx, ry, rz = tip[3, 0] - frame[3, 0], tip[3, 1] - frame[3, 1], tip[3, 2] - frame[3, 2]
            jacobian[0, joint], jacobian[1, joint], jacobian[2, joint] = wy * rz - wz * ry, wz * rx - wx * rz, wx * ry - wy * rx
            jacobian[3, joint], jacobian[4, joint], jacobian[5, joint] = wx, wy, wz
    return np.asarray(tip)


@njit(cache=True)
def pose_error(frame: np.ndarray, goal: np.ndarray, error: np.ndarray) -> tuple[float, float]:
    """Fill `error` (6,) with (x_d - x, log(R_d R^T)) of two frames (4, 3); returns its two lengths, m and rad."""
    turn = np.empty((3, 3))
    for i in range(3):
        error[i] = goal[3, i] - frame[3, i]
        for j in range(3):
            turn[i, j] = goal[i, 0] * frame[j, 0] + goal[i, 1] * frame[j, 1] + goal[i, 2] * frame[j, 2]
    x, y, z = 0.5 * (turn[2, 1] - turn[1, 2]), 0.5 * (turn[0, 2] - turn[2, 0]), 0.5 * (turn[1, 0] - turn[0, 1])
    sine, cosine = math.sqrt(x * x + y * y + z * z), 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0)
    angle = math.atan2(sine, cosine)
    if sine > 1e-6 or cosine > 0.0:
        scale = angle / sine if sine > 0.0 else 1.0
        error[3], error[4], error[5] = scale * x, scale * y, scale * z
    else:  # half a turn: the axis is the longest column of (turn + 1) / 2
        best = 0
        for i in range(1, 3):
            if turn[i, i] > turn[best, best]:
                best = i
        norm = math.sqrt(max(0.5 * (turn[best, best] + 1.0), 1e-12))
        for i in range(3):
            error[3 + i] = angle * (0.5 * (turn[i, best] + (1.0 if i == best else 0.0)) / norm)
    return math.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2), angle


@njit(cache=True)
def solve_positive(matrix: np.ndarray, right: np.ndarray) -> None:
    """Solve a small symmetric positive definite system by Cholesky; both arguments are overwritten, `right` by the solution."""
    count = len(right)
    for j in range(count):
        for k in range(j):
            matrix[j, j] -= matrix[j, k] ** 2
        matrix[j, j] = math.sqrt(max(matrix[j, j], 1e-300))
        for i in range(j + 1, count):
            for k in range(j):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
            matrix[i, j] /= matrix[j, j]
    for i in range(count):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(count - 1, -1, -1):
        for k in range(i + 1, count):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]


@njit(cache=True)
def limited_step(
    jacobian: np.ndarray, error: np.ndarray, damping: float, joints: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray:
    """Damped step (n,) from `joints` that ends within the limits; see the module's docstring."""
    count = len(joints)
    free, step, rest = np.ones(count), np.zeros(count), error.copy()
    matrix, right = np.empty((6, 6)), np.empty(6)
    for _ in range(count + 1):
        for i in range(6):
            right[i] = rest[i]
            for j in range(i + 1):
                total = damping if i == j else 0.0
                for k in range(count):
                    total += free[k] * jacobian[i, k] * jacobian[j, k]
                matrix[i, j] = total
        solve_positive(matrix, right)
        settled = True
        for k in range(count):
            if free[k] == 0.0:
                continue
            step[k] = 0.0
            for i in range(6):
                step[k] += jacobian[i, k] * right[i]
        for k in range(count):
            if free[k] == 1.0 and not lower[k] <= joints[k] + step[k] <= upper[k]:
                step[k] = (upper[k] if step[k] > 0.0 else lower[k]) - joints[k]
                free[k] = 0.0
                settled = False
                for i in range(6):
                    rest[i] -= jacobian[i, k] * step[k]
        if settled:
            break
    return step


@njit(cache=True)
def inward_move(step: np.ndarray, joints: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Move (n,) away from the limits, as large as `step` at a limit and next to nothing at mid-range."""
    size = math.sqrt((step**2).sum())
    move = np.zeros(len(joints))
    for k in range(len(joints)):
        half = 0.5 * (upper[k] - lower[k])
        if 0.0 < half < math.inf:
            move[k] = -min(size, half) * ((joints[k] - lower[k]) / half - 1.0) ** 3
    return move


@njit(cache=True)
def reach_pose(
    chain: np.ndarray, goal: np.ndarray, start: np.ndarray, lower: np.ndarray, upper: np.ndarray, rounds: int
) -> tuple[np.ndarray, float, float, int]:
    """Joint positions that bring a chain's tip to the frame `goal`, nearby `start` if there are any.

    Args:
        chain: (n+1, 16) See `chain_frame`.
        goal: (4, 3) Frame of the tip in the world.
        start: (n,) Within the limits.
        lower: (n,) [rad or m]
        upper: (n,) [rad or m]
        rounds: Most trial steps.

    Returns:
        (n,) joint positions, [m] and [rad] what is left of the error, and the number of trial steps.
    """
    joints, jacobian, trial_jacobian = start.copy(), np.empty((6, len(start))), np.empty((6, len(start)))
    error, trial_error = np.empty(6), np.empty(6)
    distance, angle = pose_error(chain_frame(chain, joints, jacobian), goal, error)
    damping = LAMBDA_START
    for count in range(rounds):
        if distance < ERROR_DONE and angle < ERROR_DONE:
            return joints, distance, angle, count
        trial = joints + limited_step(jacobian, error, damping, joints, lower, upper)
        if count == 0:
            inward = joints + inward_move(trial - joints, joints, lower, upper)
            trial = inward + limited_step(jacobian, error - jacobian @ (inward - joints), damping, inward, lower, upper)
        trial = np.minimum(np.maximum(trial, lower), upper)
        trial_distance, trial_angle = pose_error(chain_frame(chain, trial, trial_jacobian), goal, trial_error)
        if trial_distance**2 + trial_angle**2 < distance**2 + angle**2:
            joints, distance, angle = trial, trial_distance, trial_angle
            jacobian, trial_jacobian = trial_jacobian, jacobian
            error, trial_error = trial_error, error
            damping = max(0.1 * damping, LAMBDA_LEAST)
        else:
            damping *= 10.0
            if damping > 1e6:  # no step is small enough: a local minimum, or rounding
                return joints, distance, angle, count + 1
    return joints, distance, angle, rounds
