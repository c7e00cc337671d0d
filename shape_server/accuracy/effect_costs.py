"""What each effect of a request could change, and what it costs when it is on: time, unknowns, band and bytes, measured in one run.

Each cable is solved with everything that its numbers ask for; from that shape sizes are predicted, and a step is timed from it, with
everything on and with each effect in turn taken away. Without bending it is the step of a catenary, which has two unknowns for each span.
The width of the band is that of the scalars beside each other in a row of the symmetric system, the diagonal among them.
"""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass
from typing import Final

import msgspec
import numpy as np

from protocol.codec import encode
from protocol.effects import CHOOSABLE, WITH_BENDING
from protocol.kinds import Outcome
from protocol.messages import Problem, ShapeRequest, Start
from protocol.scene import Vector

from .. import effects, kernels, pieces
from ..choice import without
from ..mesh import from_nodes
from ..seen import seen_in
from ..solve import solve
from ..system import build

REPEATS: Final = 15
TRIDIAGONAL, PENTADIAGONAL = 6, 9  # scalars in a row of the band


@dataclass(frozen=True)
class EffectCost:
    """One effect of one cable; `None` of a figure that is not known because the cable cannot be solved without it."""

    cable: str
    name: str
    size: float  # m, predicted
    force: float  # N
    curvature: float  # 1/m
    is_on: bool  # by the automatic choice
    seconds: float | None  # of a step, more than without it
    unknowns: int | None  # more than without it
    band: int | None  # wider than without it
    size_of_request: int  # bytes more than without it


def costs(request: ShapeRequest) -> list[EffectCost]:
    """All effects of all cables of a request that begins from the grasps alone."""
    return [row for problem in request.problems for row in _of_cable(problem, request)]


def _of_cable(problem: Problem, request: ShapeRequest) -> list[EffectCost]:
    gravity, bare = request.gravity, msgspec.structs.replace(problem, effects=None)
    shape = solve(bare, gravity, tolerance=request.tolerance, extrapolate=False, path=kernels)
    if shape.outcome is not Outcome.CONVERGED:
        return []
    choice = solve(msgspec.structs.replace(bare, effects={}), gravity, tolerance=request.tolerance, path=kernels)
    start = Start(s=shape.s, frames=np.array(shape.frames), grasp_forces=np.ascontiguousarray(shape.grasp_wrenches[:, :3]))
    begun = msgspec.structs.replace(bare, start=start)
    names = [name for name in effects.asked_for(bare, gravity) if name in CHOOSABLE]
    seen, all_on = seen_in(bare, gravity, shape, kernels), _Step(begun, gravity, request)
    rows = []
    for name in names:
        size = effects.load(name).size(bare, gravity, seen)
        off = {name, *(other for other in names if name == "bending" and other in WITH_BENDING)}
        # Twist and gravity do not go alone: what they cost is not known.
        less = None if name in ("twist", "gravity") else _Step(*without(begun, gravity, off), request)
        has_both = less is not None and less.seconds is not None and all_on.seconds is not None
        rows.append(
            EffectCost(
                cable=problem.cable.name,
                name=name,
                size=float(size.length),
                force=float(size.force),
                curvature=float(size.curvature),
                is_on=name in choice.effects,
                seconds=all_on.seconds - less.seconds if has_both else None,  # type: ignore[union-attr, operator]
                unknowns=all_on.unknowns - less.unknowns if has_both else None,  # type: ignore[union-attr]
                band=all_on.band - less.band if has_both else None,  # type: ignore[union-attr]
                size_of_request=all_on.bytes - (all_on if less is None else less).bytes,
            )
        )
    return rows


class _Step:
    """One step from a shape that is known."""

    def __init__(self, problem: Problem, gravity: Vector, request: ShapeRequest) -> None:
        self.bytes = len(encode(msgspec.structs.replace(request, problems=(problem,), gravity=gravity)))
        self.seconds: float | None = None
        self.unknowns, self.band = _size_of(problem, gravity)
        times = []
        for _ in range(REPEATS):
            begun = time.process_time()
            shape = solve(problem, gravity, tolerance=request.tolerance, extrapolate=False, path=kernels)
            times.append(time.process_time() - begun)
            if shape.outcome is not Outcome.CONVERGED:
                return
        self.seconds = statistics.median(times)


def _size_of(problem: Problem, gravity: Vector) -> tuple[int, int]:
    """Unknowns and width of the band."""
    if problem.cable.bending is None:
        return 2 * max(len(problem.grasps.s) - 1, 0), 0
    unknowns, band = 0, TRIDIAGONAL
    for part in [problem] if len(pieces.cuts(problem)) == 2 else pieces.split(problem, gravity):
        assert part.start is not None
        mesh = from_nodes(np.array(part.start.s), part.cable.length, part.grasps.s)
        rod = build(part, gravity, effects.asked_for(part, gravity), mesh).rod
        unknowns += 3 * len(rod.lengths) + len(rod.held.rows) + len(rod.touch)
        band = max(band, PENTADIAGONAL if len(rod.elastic.smoothing) else TRIDIAGONAL)
    return unknowns, band


def costs_table(rows: list[EffectCost], tolerance: float) -> str:
    """One row an effect, and what the columns mean."""
    head = ("cable", "effect", "size", "of tolerance", "force", "curvature", "auto", "ms a step", "unknowns", "band", "bytes")
    cells = [head, *(_cells(row, tolerance) for row in rows)]
    widths = [max(len(line[column]) for line in cells) for column in range(len(head))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in cells]
    told = (
        f"size, force and curvature: bounds of what leaving the effect out could change; tolerance {tolerance:g} m\n"
        "ms, unknowns, band, bytes: what it adds when it is on, to a step from the shape before and to its request; -: it does not go alone"
    )
    return "\n".join([*lines, told])


def _cells(row: EffectCost, tolerance: float) -> tuple[str, ...]:
    return (
        row.cable,
        row.name,
        f"{row.size:.1e} m",
        f"{row.size / tolerance:.1e}",
        f"{row.force:.1e} N",
        f"{row.curvature:.1e} 1/m",
        "on" if row.is_on else "off",
        "-" if row.seconds is None else f"{1e3 * row.seconds:+.2f}",
        "-" if row.unknowns is None else f"{row.unknowns:+d}",
        "-" if row.band is None else f"{row.band:+d}",
        f"{row.size_of_request:+d}",
    )
