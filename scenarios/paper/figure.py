"""What stands on the page for a figure of the paper: the claim, what was measured, and curves to draw.

Panels are data. `viz_client` draws them, from the file that `cablecosim paper` writes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from .recorded import Recorded

Place = tuple[float, float]
CURVES: Final = ("cable", "before", "reference", "path", "points", "body")
"""Kinds of curve: a posture; one on the way; of another making; where something went; measured points; the outline of a body, filled."""
MARKS: Final = ("gripper", "obstacle", "contact", "note")


@dataclass(frozen=True)
class Curve:
    """A line or points in the plane of a panel; with a label it stands in the legend."""

    x: tuple[float, ...]
    y: tuple[float, ...]
    kind: str = "cable"  # one of CURVES
    label: str = ""


@dataclass(frozen=True)
class Mark:
    """One place in a panel, with a word beside it."""

    x: float
    y: float
    kind: str = "note"  # one of MARKS
    label: str = ""


@dataclass(frozen=True)
class Panel:
    """One picture of a figure, in the figure's own view."""

    caption: str
    curves: tuple[Curve, ...]
    marks: tuple[Mark, ...] = ()
    x_label: str = "x [m]"
    y_label: str = "z [m]"
    is_to_scale: bool = True  # both axes alike; for places, not for other quantities
    x_range: Place | None = None  # to give panels beside each other the same axes
    y_range: Place | None = None
    is_wide: bool = False  # takes the whole width of the page


@dataclass(frozen=True)
class Screenshot:
    """A picture of a key posture in three dimensions, drawn while the take ran."""

    caption: str
    take: str
    picture: str  # name of the key posture, one of the scene's `pictures`


@dataclass(frozen=True)
class Phenomenon:
    """One thing that the figure shows, as a sentence that holds or does not."""

    name: str  # what is looked at
    paper: str  # what the paper says of it
    measured: str  # what was found, with its unit
    holds: bool


@dataclass(frozen=True)
class Result:
    """What was measured from the recordings of a figure's takes."""

    phenomena: tuple[Phenomenon, ...]
    differs: str  # what is not as in the paper, and why
    panels: tuple[Panel, ...] = ()
    screenshots: tuple[Screenshot, ...] = ()


@dataclass(frozen=True)
class Take:
    """One run of a scene."""

    name: str  # within its figure
    scene: str  # built-in, such as "paper/fig_3_held"
    settings: tuple[str, ...] = ()  # as by --set
    pictures: bool = False  # whether its key postures are drawn in three dimensions


@dataclass(frozen=True)
class Figure:
    """A figure of the paper, or several that show one thing."""

    name: str  # such as "Figs. 10 and 11"
    title: str
    claim: str  # what the paper says, in our words
    takes: tuple[Take, ...]
    measure: Callable[[Mapping[str, Recorded]], Result]  # takes by name
    procedure: tuple[str, ...] = ()  # steps for whoever wants to repeat it on a real cable


def curve(nodes: np.ndarray, kind: str = "cable", label: str = "", axes: tuple[int, int] = (0, 2)) -> Curve:
    """Places (n, 3) [m] as a curve in the plane of two axes, x and z unless given."""
    first, second = (tuple(np.round(nodes[:, axis], 6).tolist()) for axis in axes)
    return Curve(first, second, kind, label)


def mark(place: np.ndarray, kind: str = "note", label: str = "", axes: tuple[int, int] = (0, 2)) -> Mark:
    """A place (3,) [m] as a mark in the plane of two axes, x and z unless given."""
    return Mark(round(float(place[axes[0]]), 6), round(float(place[axes[1]]), 6), kind, label)
