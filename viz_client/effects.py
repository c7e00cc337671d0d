"""Which effects were simulated when and why, and what the others could have changed: a picture beside the recording.

Above, a bar for each effect that there was a choice about: full while it was on, hollow while it was left out, with the reason in it.
Below, what was said that each left-out effect could move a node by at most, on a logarithmic axis with the tolerance, and what audits
found.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any, Final

from protocol import recording
from protocol.effects import AUDIT
from protocol.messages import Audited, Frame

from .chart import COLOURS, axes_above_each_other, svg_text

FILE_NAME: Final = "effects.svg"
LEAST: Final = 1e-6  # mm; the axis goes no further down
NO_CHOICE: Final = "no choice"
WORD: Final = 0.06  # of the run; reasons of shorter stretches are not written


@dataclass
class Track:
    """One effect of one cable over the run."""

    name: str
    times: list[float] = field(default_factory=list)  # s
    states: list[tuple[bool, str]] = field(default_factory=list)  # whether it was on, and why
    sizes: list[float] = field(default_factory=list)  # mm; not a number while it was on
    audits: list[tuple[float, Audited]] = field(default_factory=list)  # s of the audited step, and what was found


def write_effects(run: recording.Recording, file: Path) -> str:
    """Draw the choice of effects of a run; the sentence that stands below it. Nothing is written for a run without a choice."""
    frames = [frame for frame in run.frames if not frame.relaxation]
    found = tracks(frames, [cable.name for cable in run.snapshot.scene.cables])
    if not found:
        return ""
    tolerance = 1e3 * run.snapshot.scene.tolerance
    told = sentence(found, tolerance)
    file.write_text(drawn(found, tolerance, told), encoding="utf-8")
    return told


def tracks(frames: Sequence[Frame], cables: Sequence[str]) -> list[Track]:
    """Every effect of every cable that there was a choice about."""
    found: dict[tuple[int, str], Track] = {}
    for frame in frames:
        for audit in frame.audits:
            found[audit.cable, audit.name].audits.append((frames[audit.step].time, audit))
        for cable, shape in enumerate(frame.shapes):
            said = {one.name: one for one in shape.predicted}
            known = {name for own, name in found if own == cable}
            for name in [*said, *sorted(known - set(said))]:
                one = said.get(name)
                label = name if len(cables) == 1 else f"{name} of {cables[cable]}"
                track = found.setdefault((cable, name), Track(label))
                track.times.append(frame.time)
                # Where nothing can be left out, as in contact, or audits have switched on all that could, nothing is predicted.
                own = AUDIT if any(audit.is_broken for _, audit in track.audits) else NO_CHOICE
                track.states.append((name in shape.effects, own) if one is None else (one.is_on, one.why))
                track.sizes.append(math.nan if one is None or one.is_on else 1e3 * one.size)
    return list(found.values())


def sentence(found: Sequence[Track], tolerance: float) -> str:
    """What the choice came to in words; tolerance in mm."""
    sizes = {track.name: [size for size in track.sizes if not math.isnan(size)] for track in found}
    off = [f"{name} (at most {max(own):.2g} mm)" for name, own in sizes.items() if own]
    told = f"Left out, at a tolerance of {tolerance:.3g} mm: " + ", ".join(off) + "." if off else "Nothing was left out."
    audits = [audit for track in found for _, audit in track.audits]
    shares = [audit.actual / audit.bound for audit in audits if audit.actual is not None and audit.bound > 0.0]
    if shares:
        broken = sum(audit.is_broken for audit in audits)
        told += f" {len(audits)} audits: what was left out moved the cable by {max(shares):.0%} of its bound at most; "
        told += f"{broken} of the bounds {'was' if broken == 1 else 'were'} broken." if broken else "no bound was broken."
    return told


def drawn(found: Sequence[Track], tolerance: float, told: str) -> str:
    """The picture, as the text of an SVG element."""
    has_bounds = not all(math.isnan(size) for track in found for size in track.sizes)
    figure, above, below = axes_above_each_other(
        (7.6, (3.4 if has_bounds else 1.4) + 0.25 * len(found)), (0.25 * len(found) + 0.2, 2.4 if has_bounds else 1e-3)
    )
    whole = max(found[0].times[-1] - found[0].times[0], 1e-9)
    colours = [COLOURS[number % len(COLOURS)] for number in range(len(found))]
    for row, (track, colour) in enumerate(zip(found, colours, strict=True)):
        _bar(above, row, track, colour, whole)
        below.plot(track.times, [max(size, LEAST) for size in track.sizes], color=colour, linewidth=1.4, label=track.name)
        for time, audit in track.audits:
            if audit.actual is not None:
                look = {"marker": "X", "color": "#d00000"} if audit.is_broken else {"marker": "o", "color": colour}
                below.plot([time], [max(1e3 * audit.actual, LEAST)], markersize=7, markeredgecolor="white", zorder=3, **look)
    above.set_yticks(range(len(found)), [track.name for track in found])
    above.invert_yaxis()
    above.set_title("on (full) and left out (hollow), and why", fontsize=9, loc="left")
    figure.supxlabel(told, fontsize=8, wrap=True)
    if not has_bounds:
        below.remove()
        above.tick_params(labelbottom=True)
        above.set_xlabel("simulated time [s]")
        return svg_text(figure)
    below.axhline(tolerance, color="#222222", linewidth=1, linestyle="--")
    below.annotate(
        "tolerance", (0.0, tolerance), xycoords=("axes fraction", "data"), xytext=(3, -9), textcoords="offset points", fontsize=7
    )
    below.set_yscale("log")
    below.margins(x=0.0)
    below.grid(axis="y", linewidth=0.3, color="#dddddd")
    below.set_title("bound of what is left out (lines), and what audits found (points; X: above the bound)", fontsize=9, loc="left")
    below.set_xlabel("simulated time [s]")
    below.set_ylabel("moves a node by [mm]")
    return svg_text(figure)


def _bar(axes: Any, row: int, track: Track, colour: str, whole: float) -> None:
    """One effect's stretches, each to where the next begins."""
    places = [list(own) for _, own in groupby(range(len(track.states)), lambda number: track.states[number])]
    for own in places:
        is_on, why = track.states[own[0]]
        end = track.times[min(own[-1] + 1, len(track.times) - 1)]
        width = end - track.times[own[0]]
        look = {"color": colour, "alpha": 0.85} if is_on else {"facecolor": "white", "edgecolor": colour, "linewidth": 1}
        axes.barh(row, width, left=track.times[own[0]], height=0.7, **look)
        if width > WORD * whole:
            axes.text(
                track.times[own[0]] + 0.5 * width, row, why, ha="center", va="center", fontsize=7, color="white" if is_on else "#222222"
            )
