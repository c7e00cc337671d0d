"""Fig. 3: a cable held at its ends, and one held at two places between them as well; same equation, other conditions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from protocol.messages import Frame

from .catenary import misses
from .figure import Figure, Panel, Phenomenon, Result, Take, curve, mark
from .recorded import Recorded

OFF = 1e-9  # m; measured 2e-14


def measure(takes: Mapping[str, Recorded]) -> Result:
    """Pulls of both cables, part by part."""
    frame = takes["held"].at("held")
    weight = takes["held"].weight()
    (free,), held = misses(frame, weight), misses(frame, weight, 1)
    pulls = [pull for pull, _ in held]
    phenomena = (
        Phenomenon(
            "cable [a2], held at its ends",
            "one catenary",
            f"horizontal pull {free[0]:.3f} N; nodes off the catenary of that pull by {free[1]:.1g} m",
            free[1] < OFF,
        ),
        Phenomenon(
            "cable [a1], held at two places more",
            "another shape by the same equation",
            f"three catenaries, of {', '.join(f'{pull:.3f}' for pull in pulls)} N; off them by {max(off for _, off in held):.1g} m",
            len(held) == 3 and max(off for _, off in held) < OFF and np.ptp(pulls) > 0.1 * free[0],
        ),
    )
    return Result(phenomena, DIFFERS, (_panel(frame),))


def _panel(frame: Frame) -> Panel:
    curves = (
        curve(frame.shapes[1].nodes, label="[a1] held between its ends too"),
        curve(frame.shapes[0].nodes, "reference", "[a2] held at its ends"),
    )
    places = tuple(mark(place, "gripper") for place in frame.grasps[1].position)
    return Panel("Two cables of 12 m that obey one equation.", curves, places)


DIFFERS = (
    "The paper prints no numbers: places and lengths are ours. Where it says that one more condition lets the curvature change, our cable "
    "without bending has a kink: the held places bear the difference of the two pulls."
)
FIGURE = Figure(
    name="Fig. 3",
    title="Held at two ends, and at intermediate points",
    claim="Two cables that obey the same (second-order) equation have different shapes, depending on whether they are held at intermediate "
    "points: obstacles can be handled as extra conditions.",
    takes=(Take("held", "paper/fig_3_held"),),
    measure=measure,
)
