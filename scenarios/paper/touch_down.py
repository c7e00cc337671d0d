"""The touch-down experiment: a hand lowers a cable on to a table and raises it; a mark on the cable tells the kinds of contact apart."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from protocol.messages import Frame

from .figure import Curve, Figure, Panel, Phenomenon, Result, Take, curve, mark
from .recorded import Recorded, place_at, touched

MARK: Final = 0.5  # m along the cable
KINDS: Final = {"none": "FØ, none", "bond": "F∞, bond", "signum": "Fσ, signum, mu = 0.4"}
LYING: Final = 0.0046  # m, height of the axis of the cable where it lies on the table, and a tenth of a millimetre
REST: Final = 1e-5  # m
SEEN: Final = 1e-3  # m, what is seen with a ruler


def measure(takes: Mapping[str, Recorded]) -> Result:
    """Ways of the mark while it lies, down and up, and by how much up differs from down at the same height of the hand."""
    way = {kind: _lying(takes[kind]) for kind in KINDS}
    loop = {kind: _loop(takes[kind]) for kind in KINDS}
    phenomena = (
        Phenomenon(
            "FØ: the mark, while it lies",
            "(no friction) the same way there and back",
            f"goes {_millimetres(np.ptp(way['none']))}; up differs from down by {_millimetres(loop['none'])}",
            np.ptp(way["none"]) > 5 * SEEN and loop["none"] < SEEN,
        ),
        Phenomenon(
            "F∞: the mark, while it lies",
            "(a bond) it stays",
            f"goes {_millimetres(np.ptp(way['bond']))}",
            bool(np.ptp(way["bond"]) < REST),
        ),
        Phenomenon(
            "Fσ: the mark, while it lies",
            "(friction) it stays, slides, stays",
            f"goes {_millimetres(np.ptp(way['signum']))}; up differs from down by {_millimetres(loop['signum'])}",
            SEEN < np.ptp(way["signum"]) < np.ptp(way["none"]) and loop["signum"] > SEEN,
        ),
    )
    return Result(phenomena, DIFFERS, (*(_panel(takes[kind], words) for kind, words in KINDS.items()), _ways(takes)))


def _x(frame: Frame) -> float:
    return float(place_at(frame.shapes[0], MARK)[0])


def _is_lying(frame: Frame) -> bool:
    return len(touched(frame)) > 0 and float(place_at(frame.shapes[0], MARK)[2]) < LYING


def _lying(take: Recorded) -> np.ndarray:
    """Where along x [m] the mark is while it lies."""
    return np.array([_x(frame) for move in ("down", "up") for frame in take.during(move) if _is_lying(frame)])


def _loop(take: Recorded) -> float:
    """How far [m] the mark is off on the way up from where it was at the same height on the way down, at most, while it lies both times."""
    down, up = list(take.during("down")), list(take.during("up"))
    pairs = zip(down[-2::-1], up, strict=False)  # the way up is the way down backwards
    return max((abs(_x(first) - _x(last)) for first, last in pairs if _is_lying(first) and _is_lying(last)), default=0.0)


def _millimetres(value: float) -> str:
    return f"{1e3 * float(value):.1f} mm"


def _panel(take: Recorded, words: str) -> Panel:
    above, down = take.at("above"), take.at("down")
    ground = Curve((-0.05, 0.9, 0.9, -0.05), (-0.03, -0.03, 0.0, 0.0), "body")
    marks = [mark(place, "gripper") for place in down.grasps[0].position]
    marks.append(mark(place_at(down.shapes[0], MARK), "contact", "mark"))
    curves = (curve(down.shapes[0].nodes), curve(above.shapes[0].nodes, "reference"), ground)
    return Panel(f"{words}: lowered. Dashed: before.", curves, tuple(marks), x_range=(-0.05, 0.9), y_range=(-0.03, 0.5))


def _ways(takes: Mapping[str, Recorded]) -> Panel:
    curves = []
    for kind, words in KINDS.items():
        frames = [frame for move in ("down", "up") for frame in takes[kind].during(move)]
        height = tuple(1e2 * float(frame.grasps[0].position[1, 2]) for frame in frames)
        curves.append(Curve(height, tuple(1e2 * _x(frame) for frame in frames), "cable", words))
    return Panel(
        "Where the mark is, over the height of the front hand: one line there and back, a line that is level while the mark lies, or a "
        "loop.",
        tuple(curves),
        x_label="height of the front hand [cm]",
        y_label="x of the mark [cm]",
        is_to_scale=False,
        is_wide=True,
    )


DIFFERS = (
    "The paper names the experiment and does not describe it; this one is ours. It is a scene here, with the outcome that each kind of "
    "contact has; what your cable does on your table decides which kind is right for it. More in docs/touch_down.md."
)
PROCEDURE = (
    "Take the cable by two places a metre apart, with a strip of tape half-way. Hold the rear one 20 cm above a table, the front one 80 cm "
    "in front of it and 45 cm above the table, so that the cable hangs free.",
    "Lower the front hand by 22 cm within some ten seconds, straight down, and raise it again. At every 2 cm write down where the tape is "
    "along the table, and whether it lies. (A film with a ruler in it does.)",
    "Do it again in two seconds. If the tape is elsewhere by more than you can read off, a quasi-static model will not do for the faster "
    "motion.",
    "Draw the place of the tape over the height of the hand, as in the last plot. The same way there and back: `none` (FØ). Level while "
    "the tape lies: `bond` (F∞). A loop: friction, `signum` (Fσ); if a slower motion makes a narrower loop, `regularized` (FR).",
    "For a loop, find the coefficient with which the scene has yours: `cablecosim run paper/touch_down --set bodies.ground.friction=signum "
    "--set bodies.ground.friction_coefficient=0.4`, with the mass and the stiffness of your cable.",
    "For the stiffness, measure points of the cable while it hangs free and give them to `cablecosim calibrate POINTS.csv POSTURE.toml`; "
    "it says how well each number is determined.",
)
FIGURE = Figure(
    name="Touch-down",
    title="An experiment that tells which kind of contact fits",
    claim="A touch-down experiment can be used to find out whether the quasi-static approach is appropriate, and a series of them to "
    "validate the type of interaction in each case study.",
    takes=(
        Take("none", "paper/touch_down"),
        Take("bond", "paper/touch_down", ("bodies.ground.friction=bond",)),
        Take("signum", "paper/touch_down", ("bodies.ground.friction=signum", "bodies.ground.friction_coefficient=0.4")),
    ),
    measure=measure,
    procedure=PROCEDURE,
)
