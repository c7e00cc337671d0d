"""Measured points of a cable: from a file with one point a line, and how far they are from a predicted shape."""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline

from protocol.errors import CablecosimError
from protocol.messages import EXTENT_MAX, Shape

UNITS: Final = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
HEADING: Final = re.compile(r"^\s*([xyz])\s*(?:[\[(]\s*(\w+)\s*[\])]|[_ ]\s*(\w+))?\s*$", re.IGNORECASE)
POINTS_LEAST, POINTS_MOST = 4, 100_000
BETWEEN: Final = 4  # places between two nodes where the nearest one is looked for first
ROUNDS: Final = 4  # of Newton's method for the nearest place


@dataclass(frozen=True)
class Measured:
    """Points on the axis of a cable, in any order."""

    points: np.ndarray  # (m, 3) m; zero along an axis that was not measured
    axes: np.ndarray  # (3,) bool, which of x, y and z were measured

    @property
    def freedom(self) -> int:
        """How many numbers the points have to say: two each, or one each where two axes were measured."""
        return len(self.points) * (int(self.axes.sum()) - 1)


def read_points(path: Path) -> Measured:
    """Points in a file of comma-separated values, whose first line names the columns: x, y and z, or two of them.

    A unit may follow, as in `x [mm]` or `x_mm`; metres without one. Other columns are left alone.

    Raises:
        CablecosimError: If the file cannot be read so; names line and value.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [(number, row) for number, row in enumerate(csv.reader(file), 1) if any(cell.strip() for cell in row)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise CablecosimError(f"{path}: cannot be read as comma-separated text: {reason}", key=str(path)) from error
    columns = _columns(path, rows[0][1] if rows else [])
    if not POINTS_LEAST <= len(rows) - 1 <= POINTS_MOST:
        raise CablecosimError(f"{path}: holds {len(rows) - 1} points; give {POINTS_LEAST} to {POINTS_MOST}", key=str(path))
    points = np.zeros((len(rows) - 1, 3))
    for point, (number, row) in zip(points, rows[1:], strict=True):
        for axis, (column, unit) in columns.items():
            point[axis] = _number(path, number, row[column] if column < len(row) else "") * unit
    return Measured(points, np.array([axis in columns for axis in range(3)]))


def misfit(shape: Shape, measured: Measured) -> np.ndarray:
    """How far each point is from the axis, square to it, (m, 3) [m]; zero along axes that were not measured.

    The axis is the cubic spline through the nodes. A point beyond an end counts by its distance from the line of that end.
    """
    curve = CubicSpline(shape.s, shape.nodes)
    slope, bend = curve.derivative(1), curve.derivative(2)
    share = np.arange(BETWEEN) / BETWEEN
    places = np.append((shape.s[:-1, None] + share * np.diff(shape.s)[:, None]).ravel(), shape.s[-1])
    candidates = curve(places) * measured.axes
    s = np.array([places[np.argmin(((candidates - point) ** 2).sum(axis=1))] for point in measured.points])
    for _ in range(ROUNDS):
        away, t = (curve(s) - measured.points) * measured.axes, slope(s) * measured.axes
        square = np.einsum("ij,ij->i", t, t)
        along = square + np.einsum("ij,ij->i", away, bend(s) * measured.axes)
        step = np.einsum("ij,ij->i", away, t) / np.where(along > 0.1 * square, along, np.maximum(square, 1e-12))
        s = np.clip(s - step, 0.0, shape.s[-1])
    away, t = (measured.points - curve(s)) * measured.axes, slope(s) * measured.axes
    square = np.maximum(np.einsum("ij,ij->i", t, t), 1e-12)
    flat: np.ndarray = away - t * (np.einsum("ij,ij->i", away, t) / square)[:, None]
    return flat


def _columns(path: Path, heading: list[str]) -> dict[int, tuple[int, float]]:
    """Column and unit [m] of each axis that was measured."""
    columns: dict[int, tuple[int, float]] = {}
    for column, text in enumerate(heading):
        match = HEADING.match(text)
        if match is None:
            continue
        axis, unit = "xyz".index(match[1].lower()), (match[2] or match[3] or "m").lower()
        if unit not in UNITS:
            raise CablecosimError(f"{path}, line 1: unit {unit!r} of {text.strip()!r} unknown; there are {', '.join(UNITS)}", key=str(path))
        if axis in columns:
            raise CablecosimError(f"{path}, line 1: has two columns for {match[1].lower()}; leave one out", key=str(path))
        columns[axis] = (column, UNITS[unit])
    if len(columns) < 2:
        raise CablecosimError(
            f"{path}, line 1: {', '.join(heading)!r} must name the columns: x, y and z or two, as in 'x [mm], z [mm]'",
            key=str(path),
        )
    return columns


def _number(path: Path, line: int, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) < EXTENT_MAX:
        raise CablecosimError(f"{path}, line {line}: {text.strip()!r} is not a coordinate; give a finite number", key=str(path))
    return value
