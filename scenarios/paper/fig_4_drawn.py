"""Fig. 4: part of a cable lies on the ground and is drawn along it; what comes of it, by kind of friction, side by side."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from protocol.messages import Frame

from .figure import Curve, Figure, Panel, Phenomenon, Result, Take, curve, mark
from .recorded import Recorded, place_at, touched

COEFFICIENT: Final = 0.4
SPEED: Final = 0.1  # m/s
MIDDLE: Final = 0.5  # m, the place of the cable that is watched
KINDS: Final = ("none", "bond", "signum", "regularized")
SYMBOLS: Final = {"none": "FØ", "bond": "F∞", "signum": "Fσ", "regularized": "FR"}
SAME: Final = 1e-3  # of a force
MOVED: Final = 1e-4  # m in a step; less is rest
FAR: Final = 0.01  # m in a step; more is a jump


def measure(takes: Mapping[str, Recorded]) -> Result:
    """Way of the middle of the cable, and the force of friction, during the draw."""
    way = {kind: np.array([_behind(takes[kind], frame) for frame in takes[kind].during("draw")]) for kind in KINDS}
    drag = {kind: np.array([_drag(frame) for frame in takes[kind].during("draw")]) for kind in KINDS}
    limit = COEFFICIENT * np.array([_carried(frame) for frame in takes["signum"].during("draw")])
    slides = _steps(takes["signum"]) > MOVED
    share = drag["regularized"] / (COEFFICIENT * np.array([_carried(frame) for frame in takes["regularized"].during("draw")]))
    stays = _steps(takes["bond"])[_lies(takes["bond"])]
    phenomena = (
        Phenomenon(
            f"{SYMBOLS['none']} none",
            "no friction is considered",
            f"it comes all the way, {1e3 * np.abs(way['none']).max():.1g} mm behind; force {np.abs(drag['none']).max():.1g} N",
            bool(np.abs(way["none"]).max() < 1e-4 and np.abs(drag["none"]).max() < 1e-6),
        ),
        Phenomenon(
            f"{SYMBOLS['bond']} bond",
            "a bond, unless the cable is stretched",
            f"what lies stays, to {stays.max():.1g} m a step; the front lifts it off place by place, by up to {drag['bond'].max():.2f} N; "
            f"it lies down again further on, {int((_steps(takes['bond']) > FAR).sum())} times",
            bool(len(stays) > 2 and stays.max() < MOVED and drag["bond"].max() > 3 * limit.max()),
        ),
        Phenomenon(
            f"{SYMBOLS['signum']} signum",
            "friction is opposite to the velocity, of steady measure",
            f"it stays for {int((~slides).sum())} steps, then slides at {drag['signum'][slides].mean():.4f} N, "
            f"mu N being {limit[slides].mean():.4f} N; {1e3 * way['signum'][-1]:.1f} mm behind",
            bool(np.allclose(drag["signum"][slides], limit[slides], rtol=SAME) and (drag["signum"] <= limit * (1 + SAME)).all()),
        ),
        Phenomenon(
            f"{SYMBOLS['regularized']} regularized",
            "a regularized law: force grows with speed",
            f"{100 * share.max():.0f} % of mu N at the fastest, {100 * share[-1]:.0f} % at the end; "
            f"{1e3 * way['regularized'][-1]:.1f} mm behind",
            bool(0.5 < share.max() < 1.0 and share[-1] < 0.5 * share.max()),
        ),
    )
    panels = (*(_panel(takes[kind], kind) for kind in KINDS), _forces(takes, drag))
    return Result(phenomena, DIFFERS, panels)


def _middle(frame: Frame) -> float:
    """Where along x [m] the middle of the cable is."""
    return float(place_at(frame.shapes[0], MIDDLE)[0])


def _behind(take: Recorded, frame: Frame) -> float:
    """How far [m] the middle of the cable has come less than the hands."""
    before = take.at("lowered")
    return float(frame.grasps[0].position[0, 0] - before.grasps[0].position[0, 0]) - (_middle(frame) - _middle(before))


def _drag(frame: Frame) -> float:
    """Force [N] along x that both hands together draw with."""
    return float(frame.shapes[0].grasp_wrenches[:, 0].sum())


def _carried(frame: Frame) -> float:
    """Force [N] that the ground carries."""
    return float(frame.touching.force[:, 2].sum())


def _steps(take: Recorded) -> np.ndarray:
    """How far [m] the middle of the cable went in each step of the draw."""
    middle = [_middle(frame) for frame in (take.at("lowered"), *take.during("draw"))]
    return np.abs(np.diff(middle))


def _lies(take: Recorded) -> np.ndarray:
    """In which steps of the draw the middle of the cable lay before and after."""
    ends = [touched(frame)[[0, -1]] for frame in (take.at("lowered"), *take.during("draw"))]
    lies = np.array([first <= MIDDLE <= last for first, last in ends])
    both: np.ndarray = lies[1:] & lies[:-1]
    return both


def _panel(take: Recorded, kind: str) -> Panel:
    before, after = take.at("lowered"), take.at("drawn")
    ground = Curve((-0.05, 1.1, 1.1, -0.05), (-0.03, -0.03, 0.0, 0.0), "body")
    curves = (curve(after.shapes[0].nodes), curve(before.shapes[0].nodes, "reference"), ground)
    marks = [mark(place, "gripper") for place in after.grasps[0].position]
    marks += [mark(place_at(frame.shapes[0], MIDDLE), "contact") for frame in (before, after)]
    numbers = {"signum": f", mu = {COEFFICIENT}", "regularized": f", mu = {COEFFICIENT}, v0 = {SPEED} m/s"}.get(kind, "")
    caption = f"{SYMBOLS[kind]}, `{kind}`{numbers}. Dashed: before the draw. Crosses: the middle of the cable."
    return Panel(caption, curves, tuple(marks), x_range=(-0.05, 1.1), y_range=(-0.03, 0.3))


def _forces(takes: Mapping[str, Recorded], drag: Mapping[str, np.ndarray]) -> Panel:
    curves = []
    for kind in KINDS:
        begun = float(takes[kind].at("lowered").grasps[0].position[0, 0])
        hands = tuple(1e2 * (float(frame.grasps[0].position[0, 0]) - begun) for frame in takes[kind].during("draw"))
        curves.append(Curve(hands, tuple(drag[kind].tolist()), "cable", f"{SYMBOLS[kind]} {kind}"))
    return Panel(
        "What it takes to draw, over the way of the hands. Without friction nothing; the bond goes off the scale.",
        tuple(curves),
        x_label="way of the hands [cm]",
        y_label="force of friction [N]",
        is_to_scale=False,
        y_range=(-0.02, 0.4),
        is_wide=True,
    )


DIFFERS = (
    "The paper prints a sketch and names the kinds; numbers and ways are ours. Its fifth kind, Fd, is a table of speed and force: "
    '`friction = "defined"`. Both ends are held and the belly lies, so that the posture before the draw is one and the same for all '
    "kinds. A bond lets go of the ground where it would have to pull, from the front on; when the last place has let go, the cable lies "
    "down further on."
)
FIGURE = Figure(
    name="Fig. 4",
    title="Part of the cable lies on the ground, and is drawn along it",
    claim="Cases where a part of the cable is on the ground and is being drawn are highly dependent on the contact type between cable and "
    "ground: F∞, a bond unless the cable is stretched; FØ, no friction; FR, a regularized law; Fσ, the signum function, opposite to the "
    "velocity; Fd, a definition function.",
    takes=(
        Take("none", "paper/fig_4_drawn"),
        Take("bond", "paper/fig_4_drawn", ("bodies.ground.friction=bond",)),
        Take("signum", "paper/fig_4_drawn", ("bodies.ground.friction=signum", f"bodies.ground.friction_coefficient={COEFFICIENT}")),
        Take(
            "regularized",
            "paper/fig_4_drawn",
            (
                "bodies.ground.friction=regularized",
                f"bodies.ground.friction_coefficient={COEFFICIENT}",
                f"bodies.ground.friction_speed={SPEED}",
            ),
        ),
    ),
    measure=measure,
)
