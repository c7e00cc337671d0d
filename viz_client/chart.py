"""Charts as SVG text, drawn by matplotlib: axes with units, nothing fetched when the page opens."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from .history import History, Panel

SIZE: Final = (7.6, 4.6)  # inches
WIDE: Final = (6.4, 3.2)  # inches
DECADE: Final = 10.0  # from the smallest to the largest, before an axis that may be is logarithmic
COLOURS: Final = ("#0b6e4f", "#d1495b", "#00798c", "#edae49", "#5f4bb6", "#7a7a7a", "#9c6644", "#2f4858", "#c77dff", "#e85d04")
MARKS: Final = ("o", "s", "^", "D", "v", "P", "X", "*", ">", "<")


@dataclass(frozen=True)
class Series:
    """Points of one kind, with a word beside each."""

    name: str
    x: Sequence[float]
    y: Sequence[float]
    words: Sequence[str] = ()


def error_against_time(series: Sequence[Series], frontier: tuple[Sequence[float], Sequence[float]], measured: str) -> str:
    """Error over the CPU time of what was measured, on logarithmic axes, the frontier as a line, as the text of an SVG element."""
    figure, axes = canvas(SIZE)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.step(*frontier, where="post", color="#bbbbbb", linewidth=4, marker="o", markersize=11, zorder=1, label="frontier")
    for number, one in enumerate(series):
        look = {"color": COLOURS[number % len(COLOURS)], "marker": MARKS[number % len(MARKS)], "markersize": 6}
        axes.plot(one.x, one.y, linestyle="-" if len(one.x) > 4 else "none", linewidth=1, label=one.name, zorder=2, **look)
        for x, y, word in zip(one.x, one.y, one.words, strict=False):
            axes.annotate(word, (x, y), textcoords="offset points", xytext=(5, 4), fontsize=7, color=look["color"])
    axes.set_xlabel(f"CPU time of {measured} [ms]")
    axes.set_ylabel("error of the nodes over the length [-]")
    axes.grid(which="both", linewidth=0.3, color="#dddddd")
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
    return svg_text(figure)


def stacked_over_time(series: Sequence[Series], sentence: str, most: float) -> str:
    """Milliseconds of every step over the simulated time, one upon the other up to `most`, as the text of an SVG element."""
    figure, axes = canvas(SIZE)
    colours = COLOURS[: len(series)]
    axes.stackplot(
        series[0].x if series else [], *(one.y for one in series), labels=[one.name for one in series], colors=colours, linewidth=0
    )
    axes.set_ylim(0.0, most)
    axes.margins(x=0.0)
    axes.set_xlabel("simulated time [s]")
    axes.set_ylabel("time that each step took, by part [ms]")
    axes.grid(axis="y", linewidth=0.3, color="#dddddd")
    handles, names = axes.get_legend_handles_labels()
    axes.legend(handles[::-1], names[::-1], fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
    figure.supxlabel(sentence, fontsize=8, wrap=True)
    return svg_text(figure)


def over_time(panel: Panel, run: History) -> str:
    """The curves of one panel over the simulated time, as the text of an SVG element."""
    figure, axes = canvas(WIDE)
    for number, curve in enumerate(panel.curves):
        axes.plot(run.time, curve.y, color=COLOURS[number % len(COLOURS)], linewidth=1.2, label=curve.name)
    known = [curve.y[curve.y > 0.0] for curve in panel.curves if (curve.y > 0.0).any()]
    if panel.is_logarithmic and known and max(y.max() for y in known) > DECADE * min(y.min() for y in known):
        axes.set_yscale("log")
    if panel.limit is not None:
        axes.axhline(panel.limit[1], color="#b3261e", linewidth=1, linestyle="--", label=panel.limit[0])
    for _, begin in run.moves[1:]:
        axes.axvline(begin, color="#dddddd", linewidth=0.8, zorder=0)
    axes.margins(x=0.0)
    axes.set_xlabel("simulated time [s]")
    axes.set_ylabel(panel.label)
    axes.grid(axis="y", linewidth=0.3, color="#dddddd")
    axes.legend(fontsize=7, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, frameon=False)
    return svg_text(figure)


def canvas(size: tuple[float, float]) -> tuple[Any, Any]:
    """An empty figure of a size [inches] and its axes."""
    import matplotlib

    matplotlib.use("svg")
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    return figure, figure.add_subplot()


def axes_above_each_other(size: tuple[float, float], heights: tuple[float, float]) -> tuple[Any, Any, Any]:
    """An empty figure of a size [inches], and two axes over the same x with these heights in proportion."""
    figure, whole = canvas(size)
    whole.remove()
    above, below = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": heights})
    return figure, above, below


def svg_text(figure: Any) -> str:
    """A figure as the text of an SVG element."""
    import matplotlib

    text = io.StringIO()
    # Fixed names and no date, so that the same numbers give the same page.
    with matplotlib.rc_context({"svg.hashsalt": "cablecosim", "svg.fonttype": "path"}):
        figure.savefig(text, format="svg", metadata={"Date": None})
    whole = text.getvalue()
    return whole[whole.index("<svg") :]
