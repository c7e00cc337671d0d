"""Fig. 5: an obstacle without friction at P, at Q, and at P again: which of two postures is taken is a matter of history."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from protocol.messages import Frame

from .figure import Curve, Figure, Mark, Panel, Phenomenon, Result, Take, curve, mark
from .recorded import Recorded, obstacle, slacks, touched

STRETCHED = 0.05  # slack over length, below which a part counts as stretched; the other one has more than five times that
RUN_OVER = 1.0  # m of cable over the obstacle in one step, which is a snap
SAME = 0.03  # m, place touched; the cables differ in their thickness, 0.1 m and 0.05 m, and so do their places, by 0.01 m


def measure(takes: Mapping[str, Recorded]) -> Result:
    """Postures [b] and [c], the one after the way to Q and back, and the snap on the straight way."""
    straight, take = takes["snap"], takes["history"]
    a, b, c, back = (take.at(name) for name in ("a", "b", "c", "back"))
    moved = float(np.linalg.norm(obstacle(take, b) - obstacle(take, back)))
    phenomena = (
        Phenomenon("[a]", "the cable does not touch", f"{len(touched(a))} contacts", len(touched(a)) == 0),
        Phenomenon("[b], obstacle at P", "split into two parts", f"two parts, of {_parts(take, b)} m", len(slacks(b)) == 2),
        Phenomenon(
            "[c], obstacle at Q",
            "one part is stretched",
            f"slack {_percent(c)} of the parts",
            min(slacks(c)) < STRETCHED < max(slacks(c)) / 5,
        ),
        Phenomenon(
            "at P again", "the posture of [c] is acceptable there too", f"slack {_percent(back)}; [b] had {_percent(b)}", _is_other(b, back)
        ),
        Phenomenon(
            "what decides",
            "the motion history",
            f"same grippers and obstacle, to {moved:.1g} m; {abs(_place(b) - _place(back)):.2f} m of cable are on the other side of it",
            moved < 1e-9 and abs(_place(b) - _place(back)) > 1.0,
        ),
        _snapped(straight, c),
    )
    return Result(phenomena, DIFFERS, (*_panels(take), _snap(straight)))


def _snapped(straight: Recorded, c: Frame) -> Phenomenon:
    """Straight across: one motion, at both ends of which the obstacle is touched; then the posture of [c]."""
    before, *between, after = straight.motion()
    end, moved = straight.at("c"), obstacle(straight, before) - obstacle(straight, after)
    shown = sum(frame.relaxation > 0.0 for frame in straight.frames)
    return Phenomenon(
        "P to Q, straight across",
        "not in the paper; a sudden change is smoothened (section 5.3)",
        f"[b] ends while the obstacle goes {np.linalg.norm(moved):.2f} m: {_place(before) - _place(after):.2f} m of cable run over it, "
        f"without leaving it, in {after.time - before.time:.2f} s (a pendulum's, {len(between)} frames), to the posture of [c]",
        shown == len(between) and _place(before) - _place(after) > RUN_OVER and abs(_place(end) - _place(c)) < SAME,
    )


def _snap(take: Recorded) -> Panel:
    motion = take.motion()
    between = [curve(motion[index].shapes[0].nodes, "before") for index in np.linspace(1, len(motion) - 2, 4).round().astype(int)]
    ends = [curve(motion[0].shapes[0].nodes, label="[b], at its end"), curve(motion[-1].shapes[0].nodes, "reference", "[c]")]
    marks = (*_held(motion[0], "DC"), mark(obstacle(take, motion[-1]), "obstacle", "between P and Q"))
    return Panel("Straight from P to Q: [b] snaps to [c].", (*between, *ends), marks, x_range=(-0.6, 5.6), y_range=(-5.6, 2.6))


def _place(frame: Frame) -> float:
    """Arc length [m] that the obstacle touches."""
    return float(touched(frame).mean()) if len(touched(frame)) else 0.0


def _parts(take: Recorded, frame: Frame) -> str:
    return f"{_place(frame):.2f} and {take.scene.cables[0].length - _place(frame):.2f}"


def _percent(frame: Frame) -> str:
    return " and ".join(f"{100 * slack:.1f} %" for slack in slacks(frame))


def _is_other(b: Frame, back: Frame) -> bool:
    """Whether it is the other part that is nearly straight."""
    return len(slacks(b)) == len(slacks(back)) == 2 and int(np.argmin(slacks(b))) != int(np.argmin(slacks(back)))


def _panels(take: Recorded) -> list[Panel]:
    a, b, c, back = (take.at(name) for name in ("a", "b", "c", "back"))
    lowered = (
        "[a] to [b]: the grippers are lowered, the obstacle is at P.",
        [curve(a.shapes[0].nodes, "before", "[a]"), curve(b.shapes[0].nodes, label="[b]")],
        [*_held(a, "AB"), *_held(b, "DC"), mark(obstacle(take, b), "obstacle", "P")],
    )
    moved = (
        "[c]: the obstacle has gone to Q; one part is stretched.",
        [curve(c.shapes[0].nodes, label="[c]"), _way(take, "down", "across", "to Q")],
        [*_held(c, "DC"), mark(obstacle(take, c), "obstacle", "Q"), mark(obstacle(take, b), "note", "P")],
    )
    again = (
        "At P again: the posture is that of [c]. Dashed is [b], for the same grippers and the same obstacle.",
        [curve(back.shapes[0].nodes, label="[c] at P"), curve(b.shapes[0].nodes, "reference", "[b]"), _way(take, "back to P")],
        [*_held(back, "DC"), mark(obstacle(take, back), "obstacle", "P")],
    )
    return [
        Panel(caption, tuple(curves), tuple(marks), x_range=(-0.6, 5.6), y_range=(-5.6, 2.6))
        for caption, curves, marks in (lowered, moved, again)
    ]


def _held(frame: Frame, letters: str) -> list[Mark]:
    return [mark(place, "gripper", letter) for place, letter in zip(frame.grasps[0].position, letters, strict=True)]


def _way(take: Recorded, *moves: str) -> Curve:
    return curve(np.array([obstacle(take, frame) for move in moves for frame in take.during(move)]), "path", "way of the obstacle")


DIFFERS = (
    "The paper prints no coordinates: A, B, C, D, P and Q are ours, where two postures exist at P and one at Q. A part that is stretched "
    "over an obstacle without friction is not quite straight, for it has weight and the tension is the same on both sides. From P to Q the "
    "obstacle goes around below, where the cable follows it without a jump. Straight across, [b] ends on the way, at a fold, and the cable "
    "snaps to [c]; the motion shown is artificial, and the obstacle is within the cable meanwhile, less than its radius deep."
)
FIGURE = Figure(
    name="Fig. 5",
    title="An obstacle without friction (FØ), and two postures for one place of it",
    claim="As the grippers are lowered from (a), an obstacle at P splits the cable into two parts, posture [b]. With the obstacle at Q, "
    "weight and tension give [c], which has a stretched part. [c] is acceptable for P too: an ambiguity, and the motion history says which "
    "of the two it is.",
    takes=(Take("history", "paper/fig_5_history"), Take("snap", "paper/fig_5_snap")),
    measure=measure,
)
