"""Where a picture is taken from: the cable and its grippers fill it, seen over the robot's shoulder.

A point at (x, y, z) in the camera's frame (right, up, ahead) appears at x / (z tan(fov / 2)) of half the picture's
height. A distance from which all points of interest are seen follows in closed form for a given direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from protocol.messages import Frame

from .surface import Floats

DIRECTIONS: Final = tuple(  # of sight, as angle from where the robot faces (+x) to its left, and downwards; best first
    (np.radians(turn), np.radians(dip)) for dip in (38, 24, 55) for turn in (55, 30, 80, -55, -30, -80, 12, -12, 0)
)
FIELD_OF_VIEW: Final = 0.50  # rad, vertical; a longer lens than a room camera's, so that near grippers do not loom
MARGIN: Final = 0.12  # of the picture, left free on every side
GRIPPER: Final = 0.07  # m, half the size of a hand around a held point


@dataclass(frozen=True)
class View:
    """A camera with the horizon level."""

    eye: Floats  # (3,) m
    target: Floats  # (3,) m, in the middle of the picture
    field_of_view: float = FIELD_OF_VIEW  # rad, vertical

    def axes(self) -> Floats:
        """Unit vectors (right, up, ahead) as the rows of a (3, 3) array."""
        return _axes(self.target - self.eye)

    def pixels(self, points: Floats, width: int, height: int) -> Floats:
        """Where points appear.

        Args:
            points: (n, 3) [m]
            width: [pixel] Of the picture.
            height: [pixel] Of the picture.

        Returns:
            (n, 3) Column and row [pixel] from the upper left corner, and depth [m] ahead of the eye.
        """
        right, up, ahead = ((points - self.eye) @ self.axes().T).T
        scale = 0.5 * height / (np.tan(0.5 * self.field_of_view) * ahead)
        return np.stack([0.5 * width + scale * right, 0.5 * height - scale * up, ahead], axis=1)


def fit_view(frames: Sequence[Frame], *, aspect: float, direction: tuple[float, float] = DIRECTIONS[0]) -> View:
    """View in which the cables and the grippers of all `frames` are seen, with a margin.

    Args:
        frames: One or more.
        aspect: Width of the picture over its height.
        direction: [rad] Of sight: the angle to the left of +x, and the angle downwards, less than a right angle.
    """
    points = np.concatenate([_interesting(frame) for frame in frames])
    turn, dip = direction
    axes = _axes(np.array([np.cos(dip) * np.cos(turn), np.cos(dip) * np.sin(turn), -np.sin(dip)]))
    local = points @ axes.T  # (n, 3) right, up, ahead
    tangent = np.tan(0.5 * FIELD_OF_VIEW) * (1.0 - 2.0 * MARGIN) * np.array([aspect, 1.0])
    # Both borders of the picture are planes through the eye: |x - x_eye| <= tangent (z - z_eye) for all points.
    high = (local[:, :2] - tangent * local[:, 2:]).max(axis=0)
    low = (local[:, :2] + tangent * local[:, 2:]).min(axis=0)
    middle = 0.5 * (high + low)
    back = (0.5 * (low - high) / tangent).min()
    eye = np.array([middle[0], middle[1], back])
    target = np.array([middle[0], middle[1], np.median(local[:, 2])])
    return View(axes.T @ eye, axes.T @ target)


def _interesting(frame: Frame) -> Floats:
    """Corners of boxes around the held points, and the nodes of the cables: (n, 3) m."""
    corners = GRIPPER * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    hands = [(grasps.position[:, None, :] + corners).reshape(-1, 3) for grasps in frame.grasps]
    return np.concatenate([*hands, *(shape.nodes for shape in frame.shapes), frame.touching.point])


def _axes(direction: Floats) -> Floats:
    ahead = direction / np.linalg.norm(direction)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, ahead), ahead])
