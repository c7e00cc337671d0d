"""Fig. 13 and the kinds of self-interaction: a cable that is transparent to itself, one that touches itself, and one that sticks."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from protocol.messages import Frame, Shape

from .figure import Figure, Mark, Panel, Phenomenon, Result, Take, curve, mark
from .recorded import Recorded, place_at

APART = 0.1  # m along a cable, from where on two places count as two strands
PLACES = 401  # along a cable


def measure(takes: Mapping[str, Recorded]) -> Result:
    """Crossings and distances of strands, twist, and how far out of the plane."""
    crossing, wound, bond = takes["crossing"], takes["wound"], takes["bond"]
    nearest, at = closest(crossing.at("crossed").shapes[0])
    bulge = max(float(np.ptp(frame.shapes[0].nodes[:, 1])) for frame in crossing.during("apart"))
    turns = abs(_turns(crossing.at("apart").shapes[0]))
    before, after = wound.at("a turn and a half"), wound.at("wound up")
    gap, thick = closest(after.shapes[1])[0], wound.scene.cables[1].diameter
    pushes = after.shapes[1].self_reactions
    press = 0.0 if pushes is None else float(np.linalg.norm(pushes.force, axis=1).sum())
    free, kept = ((_turns(before.shapes[k]), _turns(after.shapes[k])) for k in range(2))
    phenomena = (
        Phenomenon(
            "transparent, its ends drawn past each other",
            "a plane picture in which the cable crosses itself",
            f"two strands {1e3 * nearest:.1f} mm from axis to axis, of a cable {1e3 * crossing.scene.cables[0].diameter:.0f} mm thick",
            nearest < 0.5 * crossing.scene.cables[0].diameter and bool(np.ptp(crossing.at("crossed").shapes[0].nodes[:, 1]) < 1e-6),
        ),
        Phenomenon(
            "the loop, drawn on",
            "the picture implies twisting in the real world",
            f"it leaves the plane, by up to {bulge:.2f} m, and ends with {turns:.2f} turns of twist",
            bulge > 0.1 and turns > 0.9,
        ),
        Phenomenon(
            "transparent, wound up from 1.5 to 1.75 turns",
            "not a real-world case",
            f"it passes through itself: {free[0]:.2f} turns of twist before, {free[1]:.2f} after",
            free[1] < 0.5 * free[0],
        ),
        Phenomenon(
            "touching itself, wound up as far",
            "not in the paper",
            f"strands {1e3 * gap:.1f} mm apart from axis to axis, {1e3 * thick:.0f} mm thick, that press each other with {press:.2f} N: "
            f"{kept[0]:.2f} turns before, {kept[1]:.2f} after",
            abs(gap - thick) < 5e-4 and press > 0.1 and kept[1] > 0.8 * kept[0],
        ),
        _sticking(bond, thick),
    )
    captions = (
        "Wound up, transparent: it has passed through itself and hangs nearly untwisted.",
        "Wound up, touching itself: the strands lie on each other.",
        "Wound up, sticking to itself: two points hold where they first touched.",
    )
    stuck = bond.at("wound up")
    shapes, marks = (*after.shapes, stuck.shapes[1]), ((), _touches(after.shapes[1]), _stuck(stuck))
    curled = tuple(Panel(caption, (curve(shape.nodes),), on) for caption, shape, on in zip(captions, shapes, marks, strict=True))
    return Result(phenomena, DIFFERS, (_plane(crossing, at), _opening(crossing, turns), *curled))


def _sticking(bond: Recorded, thick: float) -> Phenomenon:
    """That two points stay together, and which."""
    frames = [frame for frame in bond.frames if frame.crossing is not None and len(frame.crossing.s) and not frame.relaxation]
    first, last = (frames[k].crossing.s[0] if frames else np.full(2, np.nan) for k in (0, -1))  # type: ignore[union-attr]
    apart = [_apart(frame.shapes[1], frame.crossing.s[0]) for frame in frames if frame.crossing is not None]
    off = max(abs(distance - thick) for distance in apart) if frames else math.nan
    force = float(np.linalg.norm(frames[-1].crossing.force[0])) if frames else math.nan  # type: ignore[union-attr]
    return Phenomenon(
        "sticking to itself, wound up as far",
        "F_inf, by the geometry of contact",
        f"the points {first[0]:.3f} m and {first[1]:.3f} m along it stick where they first touch and are still those when it is wound up; "
        f"their axes stay a diameter apart within {1e3 * off:.1f} mm, and hold each other with {force:.2f} N",
        bool((first == last).all()) and off < 5e-4 and bond.is_finished,
    )


def closest(shape: Shape) -> tuple[float, np.ndarray]:
    """How near two strands of a cable come to each other [m], and the place (3,) between them."""
    s = np.linspace(shape.s[0], shape.s[-1], PLACES)
    places = np.column_stack([np.interp(s, shape.s, column) for column in shape.nodes.T])
    away = np.linalg.norm(places[:, None] - places[None], axis=2)
    away[np.abs(s[:, None] - s[None]) < APART] = np.inf
    first, second = np.unravel_index(int(np.argmin(away)), away.shape)
    return float(away[first, second]), 0.5 * (places[first] + places[second])


def _turns(shape: Shape) -> float:
    return shape.total_twist / (2.0 * math.pi)


def _plane(crossing: Recorded, at: np.ndarray) -> Panel:
    opened, crossed = crossing.at("open"), crossing.at("crossed")
    curves = (curve(opened.shapes[0].nodes, "before", "before"), curve(crossed.shapes[0].nodes, label="ends drawn past each other"))
    marks = (*(mark(place, "gripper") for place in crossed.grasps[0].position), mark(at, "contact", "in one place"))
    return Panel("Transparent: the strands cross, and nothing happens there.", curves, marks)


def _opening(crossing: Recorded, turns: float) -> Panel:
    between = tuple(curve(frame.shapes[0].nodes, "before", axes=(0, 1)) for frame in [*crossing.during("apart")][:-1:3])
    last = curve(crossing.at("apart").shapes[0].nodes, label=f"ends apart: {turns:.2f} turns of twist", axes=(0, 1))
    caption = "From above: drawn on, the plane loop opens sideways and turns into twist."
    return Panel(caption, (*between, last), y_label="y [m]", y_range=(-0.2, 0.3))


def _touches(shape: Shape) -> tuple[Mark, ...]:
    pushes = shape.self_reactions
    if pushes is None:
        return ()
    pressed = np.linalg.norm(pushes.force, axis=1) > 0.0
    return tuple(mark(place_at(shape, s), "contact") for s in pushes.s[pressed, 0])


def _apart(shape: Shape, s: np.ndarray) -> float:
    return float(np.linalg.norm(place_at(shape, s[0]) - place_at(shape, s[1])))


def _stuck(frame: Frame) -> tuple[Mark, ...]:
    return () if frame.crossing is None else tuple(mark(point, "contact", "stuck") for point in frame.crossing.point)


DIFFERS = (
    "The paper prints a picture only; all numbers are ours. It has the transparent cable in two dimensions. Here it is in three, and "
    "the plane loop lasts until it is drawn tight. One-sided contact is ours. What sticks shares a point and the normal of both surfaces, "
    "and turns freely about that normal; it never comes off."
)
FIGURE = Figure(
    name="Fig. 13",
    title="A cable that meets itself: transparent, in contact, and stuck",
    claim="Self-interaction can be left out, transparent, so that strands pass through each other. This is no real-world case, "
    "especially in 3-D; in 2-D it could imply twisting. A cable curls and twists until two of its places collide. Or they stick, F_inf.",
    takes=(
        Take("crossing", "paper/fig_13_crossing"),
        Take("wound", "paper/fig_13_wound"),
        Take("bond", "paper/fig_13_wound", ('cables.contact.self_interaction="bond"',)),
    ),
    measure=measure,
)
