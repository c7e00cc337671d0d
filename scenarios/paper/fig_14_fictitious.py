"""Fig. 14: fictitious obstacles, which keep a cable from folding too tightly: the least bend radius."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from protocol.messages import Shape

from .figure import Curve, Figure, Panel, Phenomenon, Result, Take, curve, mark
from .recorded import Recorded

EXACT = 1e-3  # of the least radius; measured 1e-5 and less


def measure(takes: Mapping[str, Recorded]) -> Result:
    """Width and radius of both folds."""
    together, radius = takes["together"], takes["together"].scene.cables[1].bend_radius
    assert radius is not None  # the scene says so
    bare, kept = together.at("together").shapes
    tight = [1.0 / float(shape.curvature.max()) for shape in (bare, kept)]
    wide = [_width(shape) for shape in (bare, kept)]
    apart = [1.0 / float(shape.curvature.max()) for shape in together.at("apart").shapes]
    phenomena = (
        Phenomenon(
            "transparent",
            "nothing keeps two parts of the cable from coming close",
            f"it bends to a radius of {1e3 * tight[0]:.1f} mm, and its fold is {1e3 * wide[0]:.0f} mm wide",
            tight[0] < 0.9 * radius,
        ),
        Phenomenon(
            "with fictitious obstacles",
            "two parts are kept from coming close to each other",
            f"it bends to {1e3 * tight[1]:.2f} mm, the least radius being {1e3 * radius:.0f} mm; its fold is {1e3 * wide[1]:.0f} mm wide",
            abs(tight[1] / radius - 1.0) < EXACT and wide[1] > 2.0 * radius * (1.0 - EXACT),
        ),
        Phenomenon(
            "a fold wide enough",
            "the obstacle is not felt",
            f"both bend to {1e3 * apart[1]:.1f} mm before, within {1e3 * abs(apart[1] - apart[0]):.0e} mm",
            abs(apart[1] - apart[0]) < 1e-9,
        ),
    )
    return Result(
        phenomena,
        DIFFERS,
        (
            _panel(together, bare, BARE),
            _panel(together, kept, CAPTION, radius),
        ),
    )


def _width(shape: Shape) -> float:
    return float(np.ptp(shape.nodes[:, 0]))


def _panel(together: Recorded, shape: Shape, caption: str, radius: float = 0.0) -> Panel:
    opened = curve(together.at("apart").shapes[0].nodes, "before", "before")
    marks = tuple(mark(place, "gripper") for place in shape.nodes[[0, -1]])
    round_it = (_circle(shape, radius),) if radius else ()
    return Panel(caption, (*round_it, opened, curve(shape.nodes, label="ends brought together")), marks, x_range=(-0.25, 0.6))


def _circle(shape: Shape, radius: float) -> Curve:
    lowest = shape.nodes[int(np.argmin(shape.nodes[:, 2]))] + [0.0, 0.0, radius]
    angle = np.linspace(0.0, 2.0 * math.pi, 73)
    return curve(lowest + radius * np.column_stack([np.cos(angle), np.zeros(73), np.sin(angle)]), "body", "fictitious obstacle")


BARE = "Transparent: the fold is as tight as weight and stiffness make it."
CAPTION = "With fictitious obstacles: the fold lies around one of the least radius."
DIFFERS = (
    "The paper draws obstacles and the segments that end on them; it prints no numbers. Here no segment is added: the least radius is a"
    " bound on the curvature everywhere, and the obstacle drawn is where the bound holds the cable. It keeps folds open, not strands "
    "that meet beside a fold: those pass through each other, as with `transparent`; `contact` keeps them apart."
)
FIGURE = Figure(
    name="Fig. 14",
    title="Fictitious obstacles",
    claim="Added obstacles, with a segment more of the cable that has fixed ends and inclinations, keep two parts of a cable from "
    "coming close to each other, and describe that real cables cannot overcome a certain curvature.",
    takes=(Take("together", "paper/fig_14_fictitious"),),
    measure=measure,
)
