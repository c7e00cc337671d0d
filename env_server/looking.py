"""Looking for what a cable is near: bodies, the robot's links, and itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from protocol.messages import Problem, SelfContacts, Shape

from .crossed import Crossed
from .first_touch import sides
from .hanging import Hanging, Near, joined
from .self_boundary import Meeting, meet
from .stage import Posture, Stage
from .touch import Candidates


@dataclass(frozen=True)
class Reach:
    """Gaps [m] up to which is looked."""

    bodies: float
    links: float
    own: float  # between strands and cables


def near(stage: Stage, index: int, shape: Shape, goal: Posture, previous: Hanging | None, reach: Reach) -> Near:
    """Places within reach on the bodies, on the robot's links, and on the cable itself."""
    own = meet(stage.scene.cables[index], shape, reach.own)
    return near_bodies(stage, index, shape, goal, previous, reach), near_links(stage, index, shape, goal, previous, reach), own


def seen(
    stage: Stage,
    was: Sequence[Hanging | None],
    shapes: Sequence[Shape],
    problems: Sequence[Problem],
    goal: Posture,
    reach: Reach,
    crossed: Crossed | None,
) -> tuple[list[Hanging], bool]:
    """The cables with their new shapes and what is near them there, and whether each has settled as far as bodies and itself go."""
    hanging, is_settled = list[Hanging](), True
    for index, (before, shape, problem) in enumerate(zip(was, shapes, problems, strict=True)):
        boundary = before.boundary if before is not None else stage.untouched(index)
        boundary = boundary.after(problem.contacts, shape, goal.surfaces)
        now = Hanging(shape, boundary, *near(stage, index, shape, goal, before, reach))
        is_settled &= boundary.is_settled(joined(now, stage.body_count, reach.bodies), shape.s)
        own = _beside_knots(index, now, crossed)
        is_settled &= own is None or own.is_settled(problem.self_contacts, shape)
        hanging.append(now)
    return hanging, is_settled


def meetings(index: int, was: Hanging | None, crossed: Crossed | None) -> SelfContacts | None:
    """Where a cable may touch itself next; None if nowhere."""
    own = None if was is None else _beside_knots(index, was, crossed)
    return None if was is None or own is None else own.contacts(was.shape.s)


def _beside_knots(index: int, cable: Hanging, crossed: Crossed | None) -> Meeting | None:
    return cable.own if cable.own is None or crossed is None else crossed.itself(index, cable.own, cable.shape)


def near_bodies(stage: Stage, index: int, shape: Shape, goal: Posture, previous: Hanging | None, reach: Reach) -> Candidates:
    """Places within reach on the bodies."""
    return stage.touch_bodies.search(
        shape.nodes,
        goal.surfaces[: stage.body_count],
        0.5 * stage.scene.cables[index].diameter,
        reach.bodies,
        cable=index,
        previous=sides(previous) if previous is not None else None,
    )


def near_links(stage: Stage, index: int, shape: Shape, goal: Posture, previous: Hanging | None, reach: Reach) -> Candidates:
    """Places within reach on the robot's links."""
    cable = stage.scene.cables[index]
    return stage.touch_links.search(
        shape.nodes,
        goal.surfaces[stage.body_count :],
        0.5 * cable.diameter,
        reach.links,
        cable=index,
        excluded=stage.excluded(cable.name, shape.s),
        previous=previous.links if previous is not None else None,
    )


def touching(stage: Stage, index: int, nodes: np.ndarray, poses: np.ndarray) -> Candidates:
    """Places on the bodies that a cable on its way touches."""
    return stage.touch_bodies.search(nodes, poses[: stage.body_count], 0.5 * stage.scene.cables[index].diameter, 0.0)
