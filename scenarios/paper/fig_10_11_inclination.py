"""Figs. 10 and 11: held at x = 3.5 with the inclination fixed at zero, and free; what each inclination costs in energy and in length."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from protocol.messages import Frame

from .figure import Curve, Figure, Mark, Panel, Phenomenon, Result, Take, curve, mark
from .recorded import Recorded

FIXED, FREE, SHORT_FIXED = 0, 1, 2  # cables
LEVEL = 1e-6  # degrees
LOOSE = 1e-6  # N m


def measure(takes: Mapping[str, Recorded]) -> Result:
    """Inclinations and moments of both, and energy and length over every inclination that the obstacle was turned to."""
    take = takes["inclination"]
    frame = take.at("level")
    fixed, free = inclination(frame, FIXED), inclination(frame, FREE)
    moments = [abs(float(frame.shapes[cable].grasp_wrenches[1, 4])) for cable in (FIXED, FREE)]
    sweep = _sweep(take)
    least, shortest, pulled = (_lowest(sweep.angles, costs) for costs in (sweep.energies, sweep.alike, sweep.lengths))
    level = float(np.interp(0.0, sweep.angles, sweep.lengths))
    phenomena = (
        Phenomenon(
            "G∞: inclination fixed",
            "zero degrees at x = 3.5",
            f"{abs(fixed):.1f} degrees; the obstacle bears a moment of {moments[0]:.3f} N m",
            abs(fixed) < LEVEL and moments[0] > LOOSE,
        ),
        Phenomenon(
            "GØ: inclination free",
            "chosen by the mechanics",
            f"{free:.2f} degrees, without a moment ({moments[1]:.1g} N m)",
            moments[1] < LOOSE,
        ),
        Phenomenon(
            "length of cable taken at the same pulls",
            "less for the free one",
            f"{level:.2f} mm more with the inclination at zero than with it free",
            level > 0.0,
        ),
        Phenomenon(
            "of all inclinations",
            "the free one results from minimizing the length",
            f"length at the same energy is least at {shortest:.2f} degrees, energy at the same length at {least:.2f} degrees; length at "
            f"the same pulls at {pulled:.0f} degrees",
            max(abs(least - free), abs(shortest - free)) < 0.5,
        ),
    )
    return Result(phenomena, DIFFERS, (*(_posture(frame, cable) for cable in (FIXED, FREE)), *_costs(sweep, free)))


def inclination(frame: Frame, cable: int) -> float:
    """Of the tangent at the obstacle [degrees]: half-way between the two chords beside it, less what their lengths make of the bend."""
    shape, place = frame.shapes[cable], frame.grasps[cable].s[1]
    if cable != FREE:
        x, y, z, w = frame.grasps[cable].quaternion[1]
        return float(np.degrees(np.arctan2(1.0 - 2.0 * (x * x + y * y), 2.0 * (x * z + w * y))))
    node = int(np.argmin(np.abs(shape.s - place)))
    before, after = (np.arctan2(d[2], d[0]) for d in np.diff(shape.nodes[node - 1 : node + 2], axis=0))
    return float(np.degrees(0.5 * (before + after)))


class _Sweep(NamedTuple):
    """What every inclination takes more than the free one."""

    angles: np.ndarray  # (a,) degrees
    energies: np.ndarray  # (a,) J, at the same length
    alike: np.ndarray  # (a,) mm of length at the same energy, the parts in the same proportion
    lengths: np.ndarray  # (a,) mm of length at the pulls of the free one


def _sweep(take: Recorded) -> _Sweep:
    """Every inclination that the obstacle was turned to; what lies between the two lengths is found by going straight."""
    rows = []
    for frame in take.during("up"):
        wanted, long, short = (_pulls(frame, cable) for cable in (FREE, FIXED, SHORT_FIXED))
        less = np.diff(frame.grasps[FIXED].s) - np.diff(frame.grasps[SHORT_FIXED].s)
        length = -1e3 * float((less * (wanted - long) / (short - long)).sum())
        free, energy, shorter = (frame.shapes[cable].energy for cable in (FREE, FIXED, SHORT_FIXED))
        alike = 1e3 * float(less.sum()) * (energy - free) / (shorter - energy)
        rows.append((inclination(frame, FIXED), energy - free, alike, length))
    return _Sweep(*np.array(sorted(rows)).T)


def _pulls(frame: Frame, cable: int) -> np.ndarray:
    """Horizontal pull (2,) [N] of both parts of a cable."""
    pulls: np.ndarray = -np.cumsum(frame.shapes[cable].grasp_wrenches[:-1, 0])
    return pulls


def _lowest(x: np.ndarray, y: np.ndarray) -> float:
    """Where the parabola through the lowest point and its neighbours is lowest."""
    k = int(np.clip(np.argmin(y), 1, len(x) - 2))
    (left, low), (middle, _), (right, high) = ((float(a), float(b)) for a, b in zip(x[k - 1 : k + 2], y[k - 1 : k + 2], strict=True))
    first, second = ((b - a) / (q - p) for (p, a), (q, b) in pairwise(((left, low), (middle, float(y[k])), (right, high))))
    return 0.5 * (left + middle) - first * (right - left) / (2 * (second - first))


def _posture(frame: Frame, cable: int) -> Panel:
    held = frame.grasps[cable].position
    marks: list[Mark] = [
        mark(held[0], "gripper"),
        mark(held[1], "obstacle", f"{abs(inclination(frame, cable)):.1f}°"),
        mark(held[2], "gripper"),
    ]
    name = "Fig. 10: inclination fixed at zero (G∞)." if cable == FIXED else "Fig. 11: inclination free (GØ). Dashed: fixed."
    curves = [curve(frame.shapes[cable].nodes)]
    if cable == FREE:
        curves.append(curve(frame.shapes[FIXED].nodes, "reference"))
    return Panel(name, tuple(curves), tuple(marks), x_range=(-0.2, 5.4), y_range=(-0.75, 0.2))


def _costs(sweep: _Sweep, free: float) -> list[Panel]:
    x = tuple(sweep.angles.tolist())
    at_free = (Mark(free, 0.0, "contact", "free"),)
    shown = (
        ("Energy at the same length, over the inclination at x = 3.5.", sweep.energies, "more energy than the free one [J]"),
        ("Length at the same energy: least where it is free.", sweep.alike, "more length than the free one [mm]"),
        ("Length at the same pulls: least elsewhere.", sweep.lengths, "more length than the free one [mm]"),
    )
    return [
        Panel(words, (Curve(x, tuple(y.tolist())),), at_free, "inclination [degrees]", label, is_to_scale=False)
        for words, y, label in shown
    ]


DIFFERS = (
    "Lengths, weight and stiffness are ours, for the paper gives the x of grippers and obstacle only. It has the free inclination from "
    "least length, and does not say what is held meanwhile. Of all postures of the same energy the free one takes least cable: that is "
    "the equilibrium, least energy for the same length, seen from the other side, for a longer cable hangs lower. At the same pulls it "
    "takes less cable than with the inclination at zero, but not least of all. The obstacle stands here as a gripper that holds one "
    'place of the cable, with any inclination; a body with `inclination = "fixed"` sets that which its own surface has.'
)
FIGURE = Figure(
    name="Figs. 10 and 11",
    title="Inclination at an intermediate contact, fixed and free",
    claim="A cable that accepts moments between grippers at x = 0 and x = 5, with an obstacle at x = 3.5. In one case (G∞) its inclination "
    "there is pre-assumed and zero; in the other (GØ) it is free to be chosen from the solution, as a result of minimizing the length of "
    "the cable.",
    takes=(Take("inclination", "paper/fig_10_11_inclination"),),
    measure=measure,
)
