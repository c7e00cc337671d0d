"""Panels of the paper's figures as SVG text: postures in their own plane, with axes, units and scale as the panel says."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from .chart import COLOURS, canvas, svg_text

WIDTH: Final = 4.6  # inches of a panel; twice that and a bit for a wide one
WIDE: Final = 9.6
HEIGHT: Final = (1.2, 4.6)  # inches, least and most
LOOKS: Final[dict[str, dict[str, Any]]] = {
    "cable": {"linewidth": 2.2, "solid_capstyle": "round", "zorder": 4},
    "before": {"linewidth": 1.0, "color": "#9aa3ad", "zorder": 2},
    "reference": {"linewidth": 1.2, "color": "#222222", "linestyle": (0, (4, 3)), "zorder": 5},
    "path": {"linewidth": 1.0, "color": "#b08900", "linestyle": (0, (1, 2)), "zorder": 1},
    "points": {"linestyle": "none", "marker": "o", "markersize": 3.6, "markerfacecolor": "none", "color": "#222222", "zorder": 6},
}
MARKS: Final[dict[str, dict[str, Any]]] = {
    "gripper": {"marker": "s", "markersize": 7, "color": "#2f4858"},
    "obstacle": {"marker": "o", "markersize": 9, "markerfacecolor": "#f4d8dc", "color": "#d1495b", "markeredgewidth": 1.4},
    "contact": {"marker": "x", "markersize": 6, "color": "#d1495b", "markeredgewidth": 1.6},
}
BODY: Final = {"facecolor": "#e3dccb", "edgecolor": "#8d8468", "linewidth": 0.8, "zorder": 0}


def draw(panel: dict[str, Any]) -> str:
    """One panel as the text of an SVG element."""
    width = WIDE if panel["is_wide"] else WIDTH
    figure, axes = canvas((width, _height(panel, width)))
    curves, bodies = panel["curves"], [curve for curve in panel["curves"] if curve["kind"] == "body"]
    for body in bodies:
        axes.fill(body["x"], body["y"], label=body["label"] or None, **BODY)
    for number, curve in enumerate(curve for curve in curves if curve["kind"] == "cable"):
        axes.plot(curve["x"], curve["y"], label=curve["label"] or None, color=COLOURS[number % len(COLOURS)], **LOOKS["cable"])
    for curve in curves:
        if curve["kind"] not in ("cable", "body"):
            axes.plot(curve["x"], curve["y"], label=curve["label"] or None, **LOOKS[curve["kind"]])
    for mark in panel["marks"]:
        if mark["kind"] in MARKS:
            axes.plot(mark["x"], mark["y"], linestyle="none", zorder=7, **MARKS[mark["kind"]])
        axes.annotate(mark["label"], (mark["x"], mark["y"]), textcoords="offset points", xytext=(7, 5), fontsize=9, zorder=8)
    _set_axes(axes, panel)
    if any(curve["label"] for curve in curves):
        axes.legend(fontsize=8, frameon=True, framealpha=0.85, edgecolor="none", loc="best")
    return svg_text(figure)


def _set_axes(axes: Any, panel: dict[str, Any]) -> None:
    if panel["is_to_scale"]:
        axes.set_aspect("equal", adjustable="box")
    if panel["x_range"]:
        axes.set_xlim(*panel["x_range"])
    if panel["y_range"]:
        axes.set_ylim(*panel["y_range"])
    axes.set_xlabel(panel["x_label"])
    axes.set_ylabel(panel["y_label"])
    axes.grid(linewidth=0.4, color="#e4e7ea")
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _height(panel: dict[str, Any], width: float) -> float:
    """Inches that fit a panel drawn to scale, so that no empty space is left beside it."""
    if not panel["is_to_scale"]:
        return 0.65 * width if not panel["is_wide"] else 0.4 * width
    across = _span(panel["x_range"], [curve["x"] for curve in panel["curves"]])
    high = _span(panel["y_range"], [curve["y"] for curve in panel["curves"]])
    return min(max((width - 0.6) * high / across + 0.6, HEIGHT[0]), HEIGHT[1])


def _span(given: Sequence[float] | None, values: list[list[float]]) -> float:
    low, high = given or (min(map(min, values)), max(map(max, values)))
    return max(high - low, 1e-9)
