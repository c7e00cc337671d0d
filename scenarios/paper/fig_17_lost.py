"""Figs. 16 and 17: what is shown when a cable loses its contact, or its shape snaps: a smooth motion from one equilibrium to the next."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from protocol.messages import Frame

from .figure import Curve, Figure, Panel, Phenomenon, Result, Take, curve, mark
from .recorded import Recorded, place_at

POINTS = 18  # along the cable, as in the paper
POSTURES = 5
EXACT = 1e-9  # m; measured 1e-15
REST = 1e-9  # m/s and m/s^2; measured 1e-13


def measure(takes: Mapping[str, Recorded]) -> Result:
    """Way of every point over the time of the motion, without and with an overshoot, and of an arch that snaps."""
    lost, swinging, arch = takes["lost"], takes["overshoot"], takes["arch"]
    motion, swing, snap = lost.motion(), swinging.motion(), arch.motion()
    time, way = _way(motion)
    speed, hurry, miss = _at_both_ends(motion)
    passed, share = _way(swing)
    asked = swinging.scene.relaxation.overshoot if swinging.scene.relaxation is not None else 0.0
    held = [len(frame.touching.s) for frame in (motion[0], motion[-1])]
    fallen = _farthest(snap[0], snap[-1])
    phenomena = (
        Phenomenon(
            "the peg is drawn out",
            "sudden loss of interaction",
            f"{held[0]} contact, then {held[1]}; the cable is {_farthest(motion[0], motion[-1]):.2f} m from its next equilibrium",
            held[0] > 0 and held[1] == 0 and _snaps(lost) == 1,
        ),
        Phenomenon(
            "duration",
            "posture 1 to posture 5 in 1 s",
            f"{time[-1] - time[0]:.3f} s, {len(motion) - 2} frames between the two equilibria",
            abs(time[-1] - time[0] - 1.0) < 1e-9,
        ),
        Phenomenon(
            f"way of each of {POINTS} points over time",
            "a polynomial of the fifth order, for every node of the cable, with zero velocity and acceleration at both ends (Eq. 1)",
            f"fits one within {miss:.0e} m; velocity {speed:.0e} m/s and acceleration {hurry:.0e} m/s^2 at its ends",
            miss < EXACT and max(speed, hurry) < REST,
        ),
        Phenomenon(
            "with an overshoot of 0.2",
            "artificial overshoot or oscillation can be added",
            f"{share.max() - 1.0:.2f} of the way too far, and at rest after {passed[-1] - passed[0]:.1f} s",
            abs(share.max() - 1.0 - asked) < 0.03 and share[-1] == 1.0,
        ),
        Phenomenon(
            "an arch turned past its fold, nothing touching it",
            "not in the paper",
            f"one snap, by {fallen:.2f} m; the time is estimated as a pendulum's, {snap[-1].time - snap[0].time:.2f} s",
            _snaps(arch) == 1 and fallen > 0.15,
        ),
    )
    panels = (_postures(motion), _profile((time, way), (passed, share)), _arch(snap))
    return Result(phenomena, DIFFERS, panels)


def _snaps(recorded: Recorded) -> int:
    """How many motions are shown."""
    return sum(not before.relaxation and bool(after.relaxation) for before, after in pairwise(recorded.frames))


def _points(frame: Frame) -> np.ndarray:
    shape = frame.shapes[0]
    return np.array([place_at(shape, s) for s in np.linspace(shape.s[0], shape.s[-1], POINTS)])


def _farthest(before: Frame, after: Frame) -> float:
    return float(np.linalg.norm(_points(after) - _points(before), axis=1).max())


def _way(motion: list[Frame]) -> tuple[np.ndarray, np.ndarray]:
    """Times (f,) [s] from the first frame on, and the share (f,) of its way that the point that goes furthest has gone."""
    places = np.array([_points(frame) for frame in motion])
    total = places[-1] - places[0]
    point = int(np.argmax(np.linalg.norm(total, axis=1)))
    share = (places[:, point] - places[0, point]) @ total[point] / (total[point] @ total[point])
    return np.array([frame.time - motion[0].time for frame in motion]), share


def _at_both_ends(motion: list[Frame]) -> tuple[float, float, float]:
    """Largest velocity [m/s] and acceleration [m/s^2] at both ends, of polynomials of order 5 through all places, and their miss [m]."""
    time = np.array([frame.time - motion[0].time for frame in motion])
    places = np.array([_points(frame) for frame in motion]).reshape(len(motion), -1)  # (f, 3 points)
    powers = time[:, None] ** np.arange(6)
    factors = np.linalg.lstsq(powers, places, rcond=None)[0]
    ends = time[[0, -1], None]
    first, second = np.arange(1, 6), np.arange(2, 6)
    speed = first * ends ** (first - 1) @ factors[1:]
    hurry = second * (second - 1) * ends ** (second - 2) @ factors[2:]
    return float(np.abs(speed).max()), float(np.abs(hurry).max()), float(np.abs(powers @ factors - places).max())


def _postures(motion: list[Frame]) -> Panel:
    """Five postures, evenly in time, by their points."""
    chosen = [motion[index] for index in np.linspace(0, len(motion) - 1, POSTURES).round().astype(int)]
    curves = [curve(_points(frame), "cable" if number in (1, POSTURES) else "before") for number, frame in enumerate(chosen, start=1)]
    curves += [curve(_points(frame), "points") for frame in chosen]
    numbers = tuple(mark(_points(frame)[POINTS // 3], "note", str(number)) for number, frame in enumerate(chosen, start=1))
    places = tuple(mark(place, "gripper") for place in motion[0].grasps[0].position)
    peg = mark(motion[0].poses[0, :3], "obstacle", "peg, drawn out along y")
    return Panel(f"Five postures of {POINTS} points, a quarter of a second apart.", tuple(curves), (*places, peg, *numbers))


def _profile(plain: tuple[np.ndarray, np.ndarray], swinging: tuple[np.ndarray, np.ndarray]) -> Panel:
    """Share of its way that a point has gone over time."""
    curves = tuple(
        Curve(tuple(time.tolist()), tuple(share.tolist()), label=label)
        for (time, share), label in ((plain, "quintic"), (swinging, "with an overshoot of 0.2"))
    )
    caption = "Share of its way that every point has gone: at rest at both ends."
    return Panel(caption, curves, x_label="time [s]", y_label="share of the way [-]", is_to_scale=False)


def _arch(snap: list[Frame]) -> Panel:
    """The arch on its way."""
    between = tuple(curve(frame.shapes[0].nodes, "before") for frame in snap[1:-1])
    ends = (curve(snap[0].shapes[0].nodes, label="before"), curve(snap[-1].shapes[0].nodes, label="after"))
    marks = tuple(mark(place, "gripper") for place in snap[0].grasps[0].position)
    return Panel("An arch whose clamps are turned down, past its fold.", (*between, *ends), marks)


DIFFERS = (
    "The paper prints a profile and five postures without numbers, but for 18 points and 1 s; sizes, stiffness and the obstacle are "
    "ours, a peg that is drawn out from beneath the cable. The motion is artificial here as there: a straight way for every point, not "
    "dynamics, and along it the cable does not keep its length. What counts as a snap is ours: a jump that stays as large when the step"
    " is made 64 times as short."
)
FIGURE = Figure(
    name="Figs. 16 and 17",
    title="Smooth motion after contact is lost",
    claim="Sudden loss of interaction may lead to free motion. It is smoothened by a polynomial of the fifth order in time for every "
    "node, with zero velocity and acceleration at both ends; artificial overshoot or oscillation can be added. With 18 points, a "
    "cable goes from posture 1 to posture 5 in 1 s.",
    takes=(
        Take("lost", "paper/fig_17_lost"),
        Take("overshoot", "paper/fig_17_lost", ("relaxation.overshoot=0.2",)),
        Take("arch", "paper/fig_17_arch"),
    ),
    measure=measure,
)
