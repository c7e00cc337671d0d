"""Figs. 28 to 30: case study II, a harness laid over a dashboard by a robot with two arms, in five screenshots."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from protocol.messages import Frame

from .figure import Curve, Figure, Panel, Phenomenon, Result, Screenshot, Take, curve, mark
from .recorded import Recorded

SCREENSHOTS = (
    ("1 clear of everything", "Fig. 28, screenshot 1: clear of everything."),
    ("2 on the dashboard", "Fig. 29, screenshot 2: the left arm has gone down."),
    ("3 towards the viewer", "Fig. 29, screenshot 3: the left arm has come towards the viewer, who stands where the robot stands."),
    ("4 over the lip", "Fig. 30, screenshot 4: the left arm has gone down before the lip."),
    ("5 clipped", "Fig. 30, screenshot 5: the right end is at its clip."),
)
DEEPEST = 1e-5  # m, of penetration; measured 5e-8
ALONG = 1e-9  # m, off a straight way


def measure(takes: Mapping[str, Recorded]) -> Result:
    """Ways of the left hand, contacts, penetration, collisions, and what the arms bear."""
    run = takes["harness"]
    frames = [run.at(name) for name, _ in SCREENSHOTS]
    counts = [len(frame.touching.s) for frame in frames]
    ways = [frames[k + 1].grasps[0].position[0] - frames[k].grasps[0].position[0] for k in range(3)]
    deepest = max(frame.penetration for frame in run.frames)
    torque = max(frame.torque_ratio for frame in run.frames)
    late = [frame.bill.total for frame in run.frames]
    phenomena = (
        Phenomenon(
            "screenshots 1 and 2",
            "the left arm moves vertically",
            f"{_words(ways[0])}; contacts: {counts[0]}, then {counts[1]}",
            _is_along(ways[0], 2) and counts[0] == 0 < counts[1],
        ),
        Phenomenon(
            "screenshots 2 and 3",
            "horizontally, towards the viewer; the cable interacts with the dashboard",
            f"{_words(ways[1])}; contacts with the {_touched(run, frames[2])}: {counts[2]}",
            _is_along(ways[1], 0) and "dashboard" in _touched(run, frames[2]),
        ),
        Phenomenon(
            "screenshots 4 and 5",
            "the same kind of interaction; the motion is vertical",
            f"{_words(ways[2])}, then the right arm to its clip; contacts with the {_touched(run, frames[4])}: {counts[3]}, {counts[4]}",
            _is_along(ways[2], 2) and all("dashboard" in _touched(run, frame) for frame in frames[3:]),
        ),
        Phenomenon(
            "the harness and the dashboard",
            "interact; nothing is passed through",
            f"at most {1e9 * deepest:.0f} nm deep in all {len(run.frames)} frames, all converged",
            deepest < DEEPEST and run.is_finished and run.converged == len(run.frames),
        ),
        Phenomenon(
            "the robot",
            "a dual-arm robot carries the harness",
            f"{sum(bool(frame.collisions) for frame in run.frames)} collisions; joint torques up to {100 * torque:.0f} % of their limits",
            torque < 1.0 and not any(frame.collisions for frame in run.frames),
        ),
        Phenomenon(
            "the three threads, by sockets",
            "shape and environment talk to each other at every time step",
            f"{1e3 * float(np.median(late)):.1f} ms a step in the median, of {1e3 * run.scene.time_step:.0f} ms of simulated time",
            len(run.frames) > 1,
        ),
    )
    shots = tuple(Screenshot(caption, "harness", name) for name, caption in SCREENSHOTS)
    return Result(phenomena, DIFFERS, (_hand(run), _shapes(frames)), shots)


def _is_along(way: np.ndarray, axis: int) -> bool:
    """Whether a way goes along one axis, and against it."""
    return bool(way[axis] < 0.0 and np.abs(np.delete(way, axis)).max() < ALONG)


def _words(way: np.ndarray) -> str:
    axis = int(np.argmax(np.abs(way)))
    return f"by {way[axis]:+.2f} m along {'xyz'[axis]}"


def _touched(run: Recorded, frame: Frame) -> str:
    """Names of the bodies touched."""
    names = [body.name for body in run.scene.bodies]
    links = len(frame.poses) - len(names)  # solids are the robot's links, then the bodies
    return " and ".join(sorted({names[solid - links] for solid in frame.touching.body.tolist() if solid >= links})) or "nothing"


def _hand(run: Recorded) -> Panel:
    time = tuple(frame.time for frame in run.frames)
    places = np.array([frame.grasps[0].position[0] for frame in run.frames])
    curves = tuple(Curve(time, tuple(places[:, axis].tolist()), label=f"{name} of the left hand") for axis, name in ((0, "x"), (2, "z")))
    return Panel("Vertical and horizontal motion of the left hand.", curves, x_label="time [s]", y_label="place [m]", is_to_scale=False)


def _shapes(frames: list[Frame]) -> Panel:
    """From the side, across the dashboard's depth."""
    curves = tuple(curve(frame.shapes[0].nodes, label=f"screenshot {number}") for number, frame in enumerate(frames, start=1))
    contacts = tuple(mark(point, "contact") for frame in frames for point in frame.touching.point[:3])
    return Panel("The five shapes from the side; the viewer is at the left.", curves, contacts)


DIFFERS = (
    "The paper's robot, harness and dashboard are those of a car maker, in a commercial program, and it prints screenshots only. Here "
    "they are two Panda arms, a dashboard that is generated, and a harness whose stiffness is scaled from published measurements of "
    "wires; sizes and ways are ours. Contact is without friction, where the paper's is a bond unless said otherwise."
)
FIGURE = Figure(
    name="Figs. 28 to 30",
    title="Case study II: a harness is laid over a dashboard",
    claim="In the automated assembly of a harness the left arm first moves vertically (screenshots 1 and 2), then horizontally, towards"
    " the viewer (3 and 4), where the cable interacts with the dashboard; in screenshots 4 and 5 the motion is vertical. Shape "
    "calculator and simulation environment communicate by sockets.",
    takes=(Take("harness", "harness_assembly", pictures=True),),
    measure=measure,
)
