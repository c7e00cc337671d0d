"""Fig. 7: a cable that just touches; the way of the right gripper decides whether contact is kept."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .catenary import misses
from .figure import Figure, Panel, Phenomenon, Result, Take, curve, mark
from .recorded import Recorded, obstacle, touched

KEPT, LOST = 0, 1  # cables


def measure(takes: Mapping[str, Recorded]) -> Result:
    """Contacts of both cables at the end of their ways, and when the one was lost."""
    take = takes["motion"]
    touch, end = take.at("touch"), take.at("end")
    force = end.touching.force[end.touching.cable == KEPT].sum(axis=0)
    holding = [len(touched(frame, LOST)) for frame in take.during("away")]
    ((_, off),) = misses(end, take.weight(LOST), LOST)
    phenomena = (
        Phenomenon(
            "before",
            "the catenary merely touches the obstacle",
            f"{len(touched(touch, KEPT))} and {len(touched(touch, LOST))} contacts",
            len(touched(touch, KEPT)) == len(touched(touch, LOST)) == 1,
        ),
        Phenomenon(
            "right gripper to (b1)",
            "the constraint continues to exist",
            f"{len(touched(end, KEPT))} contact, which pushes with {np.linalg.norm(force):.3f} N",
            len(touched(end, KEPT)) == 1,
        ),
        Phenomenon(
            "right gripper to (b2)",
            "at some time the cable ceases to be in contact",
            f"lost after {sum(count > 0 for count in holding)} of {len(holding)} steps; then one catenary, to {off:.1g} m",
            holding[-1] == 0 and any(holding) and off < 1e-9,
        ),
    )
    return Result(phenomena, DIFFERS, tuple(_panel(take, cable) for cable in (KEPT, LOST)))


def _panel(take: Recorded, cable: int) -> Panel:
    touch, end = take.at("touch"), take.at("end")
    name = ("b1", "b2")[cable]
    on_the_way = [curve(frame.shapes[cable].nodes, "before") for frame in list(take.during("away"))[3::3]]
    curves = (curve(end.shapes[cable].nodes, label=f"[{name}]"), curve(touch.shapes[cable].nodes, "reference", "before"), *on_the_way)
    body = obstacle(take, end, ("obstacle", "obstacle of lost")[cable])
    grippers = [mark(place, "gripper") for place in touch.grasps[cable].position] + [mark(end.grasps[cable].position[1], "gripper", name)]
    caption = ("b1: the gripper goes down, contact is kept.", "b2: it goes up and aside, contact is lost.")[cable]
    return Panel(caption, curves, (*grippers, mark(body, "obstacle")), x_range=(-0.6, 7.0), y_range=(-5.9, 3.6))


DIFFERS = "The paper prints no numbers: the ways of the gripper are ours."
FIGURE = Figure(
    name="Fig. 7",
    title="Motion as condition",
    claim="A catenary merely touches an obstacle that it is bonded to (F∞). If the right gripper reaches (b1), the constraint continues to "
    "exist; if it moves towards (b2), there is a time at which the cable ceases to be in contact.",
    takes=(Take("motion", "paper/fig_7_motion"),),
    measure=measure,
)
