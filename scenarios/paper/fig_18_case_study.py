"""Figs. 18 to 27: case study I, a point obstacle moved through a hanging cable without bending, in nine postures A to I."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from protocol.messages import Frame

from .catenary import miss
from .figure import Curve, Figure, Mark, Panel, Phenomenon, Result, Take, curve, mark
from .recorded import Recorded, slacks, touched

LETTERS = "ABCDEFGHI"
STRAIGHT = 5e-5  # slack of a part over its length, below which it is straight; measured 1e-5, its end being a radius off the point
EXACT = 1e-6  # m; measured 1e-13
SAME = 1e-9  # m along the cable
X_RANGE, Z_RANGE = (-0.12, 0.62), (1.35, 2.6)  # m


def measure(takes: Mapping[str, Recorded]) -> Result:
    """Contacts, parts, catenaries and forces of the nine postures."""
    case = takes["case"]
    frames = {letter: case.at(letter) for letter in LETTERS}
    bonds = {letter: touched(frame).tolist() for letter, frame in frames.items()}
    slack = {letter: slacks(frame) for letter, frame in frames.items()}
    off = max(_miss(frame, case.weight()) for frame in frames.values())
    free = [letter for letter in LETTERS if not bonds[letter]]
    kept = [bonds[letter][0] for letter in "BCD"]
    weight = case.weight() * case.scene.cables[0].length
    phenomena = (
        Phenomenon(
            "A, G, H",
            "one catenary, which the obstacle does not touch",
            f"no contact in {', '.join(free)}; lost on the way to G, where the obstacle would have had to pull the cable",
            free == ["A", "G", "H"],
        ),
        Phenomenon(
            "B, C, D",
            "the obstacle lifts the cable, which hangs in two parts (bond)",
            f"touched {1e3 * kept[0]:.1f} mm from the left end, in all three the same place; slack in both parts "
            f"{', '.join('/'.join(f'{100 * part:.0f}' for part in slack[letter]) for letter in 'BCD')} %",
            np.ptp(kept) < SAME and min(min(slack[letter]) for letter in "BCD") > 0.01,
        ),
        Phenomenon(
            "E",
            "the bond yields where the cable is stretched",
            f"left part straight (slack {slack['E'][0]:.0e}), {1e3 * (bonds['E'][0] - kept[0]):.1f} mm of cable drawn over the obstacle",
            slack["E"][0] < STRAIGHT and bonds["E"][0] > kept[0] + 0.01 and slack["E"][1] > 0.01,
        ),
        Phenomenon(
            "F",
            "the motion so far decides which shape it is",
            f"both parts slack again, and the bond where E left it, {1e3 * bonds['F'][0]:.1f} mm from the left end",
            abs(bonds["F"][0] - bonds["E"][0]) < SAME and min(slack["F"]) > 0.01,
        ),
        Phenomenon(
            "I",
            "touched again",
            f"at another place, {1e3 * bonds['I'][0]:.1f} mm from the left end",
            len(bonds["I"]) == 1 and bonds["I"][0] < 0.45,
        ),
        Phenomenon("every part of every posture", "predicted shapes", f"a catenary, its nodes off it by {off:.0e} m at most", off < EXACT),
        Phenomenon(
            "forces of grippers and obstacle",
            "-",
            f"sum to the weight of {weight:.3f} N within {max(_unbalance(frame, weight) for frame in frames.values()):.0e} N",
            max(_unbalance(frame, weight) for frame in frames.values()) < 1e-9 * weight,
        ),
    )
    return Result(phenomena, DIFFERS, (_path(case, frames), _times(case), *(_posture(frame, letter) for letter, frame in frames.items())))


def _miss(frame: Frame, weight: float) -> float:
    """How far [m] the nodes of any part are off the catenary of its pull; a straight part is none."""
    shape = frame.shapes[0]
    ends = [0, *(int(np.argmin(np.abs(shape.s - s))) for s in touched(frame)), len(shape.s) - 1]
    pulls = (-shape.grasp_wrenches[0, 0], shape.grasp_wrenches[-1, 0])
    parts = zip(ends[:-1], ends[1:], pulls, slacks(frame), strict=False)  # one pull too many where nothing is touched
    return max(miss(shape.nodes[first : last + 1], pull / weight) for first, last, pull, slack in parts if slack > STRAIGHT)


def _unbalance(frame: Frame, weight: float) -> float:
    total = frame.shapes[0].grasp_wrenches[:, :3].sum(axis=0) + frame.touching.force.sum(axis=0)
    return float(np.abs(total - [0.0, 0.0, weight]).max())


def _path(case: Recorded, frames: dict[str, Frame]) -> Panel:
    way = np.array([frame.poses[0, :3] for frame in case.frames])
    letters = tuple(mark(frame.poses[0, :3], "obstacle", letter) for letter, frame in frames.items())
    grippers = tuple(mark(place, "gripper") for place in frames["A"].grasps[0].position)
    caption = "Fig. 18: the way of the obstacle in space, with the points of interest."
    return Panel(caption, (curve(way, "path", "way of the obstacle"),), (*letters, *grippers), x_range=X_RANGE, y_range=Z_RANGE)


def _times(case: Recorded) -> Panel:
    time = tuple(frame.time for frame in case.frames)
    x, z = (tuple(float(frame.poses[0, axis]) for frame in case.frames) for axis in (0, 2))
    letters = tuple(Mark(frame.time, float(frame.poses[0, 2]), "note", frame.picture) for frame in case.frames if frame.picture)
    caption = "Fig. 18: the way of the obstacle in time."
    curves = (Curve(time, x, label="x"), Curve(time, z, label="z"))
    return Panel(caption, curves, letters, x_label="time [s]", y_label="place [m]", is_to_scale=False)


def _posture(frame: Frame, letter: str) -> Panel:
    figure = 19 + LETTERS.index(letter)
    parts = " and ".join("straight" if slack < STRAIGHT else f"{100 * slack:.0f} % slack" for slack in slacks(frame))
    marks = (
        *(mark(place, "gripper") for place in frame.grasps[0].position),
        mark(frame.poses[0, :3], "obstacle", letter),
        *(mark(point, "contact") for point in frame.touching.point),
    )
    return Panel(f"Fig. {figure}: posture {letter}, {parts}.", (curve(frame.shapes[0].nodes),), marks, x_range=X_RANGE, y_range=Z_RANGE)


DIFFERS = (
    "The paper prints the way of the obstacle and the postures as pictures, without numbers. Lengths and grippers are its own (a unit "
    "is 0.1 m here, z counts from the ground), the way is ours, chosen so that every kind of posture appears. Its bond is dropped where"
    " it would have to pull the cable, which the paper does not say. The cable, a line in the paper, is 6 mm thick here; with the 2 mm "
    "of the scene it takes three times as long."
)
FIGURE = Figure(
    name="Figs. 18 to 27",
    title="Case study I: an obstacle moved through a hanging cable",
    claim="A cable of 12 length units that bears no moments is held at x = 0 and x = 5; an obstacle moves, in space and in time, "
    "through nine points of interest, and the shapes A to I are predicted there, with a bond where it touches.",
    takes=(Take("case", "case_study_1", ("time_step=0.05", "tolerance=0.002", "cable.diameter=0.006")),),
    measure=measure,
)
