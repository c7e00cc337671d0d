"""Fig. 6: bonded to an obstacle, a part of the cable that is straight draws cable through; when both are straight, that is the end."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from protocol.kinds import Outcome

from .figure import Figure, Panel, Phenomenon, Result, Take, curve, mark
from .recorded import Recorded, obstacle, slacks, touched

STRAIGHT = 0.01  # slack over length
HANGS = 0.05


def measure(takes: Mapping[str, Recorded]) -> Result:
    """Slack of both parts in every posture, and how the run ended."""
    take = takes["distance"]
    slack = {name: slacks(take.at(name)) for name in "bcd"}
    last = take.frames[len(take.frames) - 1].shapes[0]
    half = touched(take.at("b"))
    phenomena = (
        Phenomenon(
            "(b), lowered",
            "split into two catenaries",
            f"bonded {half[0]:.3f} m along the cable; slack {_words(slack['b'])}",
            len(slack["b"]) == 2 and min(slack["b"]) > HANGS,
        ),
        Phenomenon(
            "(c), left gripper at E",
            "one straight line and one catenary",
            f"slack {_words(slack['c'])}",
            slack["c"][0] < STRAIGHT and slack["c"][-1] > HANGS,
        ),
        Phenomenon("(d), left gripper at F", "both parts stretched out", f"slack {_words(slack['d'])}", max(slack["d"]) < STRAIGHT),
        Phenomenon(
            "between (c) and (d)",
            "the gripper is further away than half the length",
            f"{touched(take.at('d'))[0] - half[0]:.2f} m of cable were drawn over the obstacle",
            touched(take.at("d"))[0] - half[0] > 1.0,
        ),
        Phenomenon("one step further", "may be catastrophical", f"refused: {last.sentence}", last.outcome is Outcome.UNREACHABLE),
    )
    return Result(phenomena, DIFFERS, (_panel(take),))


def _words(slack: list[float]) -> str:
    return " and ".join(f"{100 * part:.2f} %" for part in slack)


def _panel(take: Recorded) -> Panel:
    b, c, d = (take.at(name) for name in "bcd")
    curves = tuple(curve(frame.shapes[0].nodes, label=f"[{name}]") for name, frame in (("b", b), ("c", c), ("d", d)))
    ends = zip((b, c, d), ("b", "E", "F"), strict=True)
    marks = [mark(frame.grasps[0].position[0], "gripper", "" if name == "b" else name) for frame, name in ends]
    way = curve(
        np.array([frame.grasps[0].position[0] for move in ("to E", "to F") for frame in take.during(move)]),
        "path",
        "way of the left gripper",
    )
    last = (mark(b.grasps[0].position[1], "gripper"), mark(obstacle(take, b), "obstacle"))
    return Panel("Two catenaries; a straight part and a catenary; both straight.", (*curves, way), (*marks, *last), is_wide=True)


DIFFERS = (
    "The paper prints no numbers: those of the obstacle and of the way are ours. The paper's bond gives way to a part that is straight by "
    "stretching the other one out; ours says how: cable is drawn over the obstacle, and does not go back. Where the paper warns of a "
    "catastrophe, the run ends with a sentence, and no stretched cable is shown."
)
FIGURE = Figure(
    name="Fig. 6",
    title="A bond (F∞), and distance as criterion",
    claim="The cable is bonded to the obstacle. As the grippers are lowered to (b) it is split into two catenaries. The left gripper moves "
    "on to the left until, at E, one part is a straight line and the other a catenary (c). Further away than half the cable's length, both "
    "parts are stretched out (d), with end F: an extreme reachable configuration, beyond which it may be catastrophical.",
    takes=(Take("distance", "paper/fig_6_distance"),),
    measure=measure,
)
