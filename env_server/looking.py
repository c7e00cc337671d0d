"""Looking for what a cable is near: bodies, the robot's links, and itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from protocol.messages import Shape

from .first_touch import sides
from .hanging import Hanging, Near
from .self_boundary import meet
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
