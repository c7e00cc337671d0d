"""The cables of a scene as they hang at its start, held by the grippers and touching nothing: a question to the shape server."""

from __future__ import annotations

from typing import TYPE_CHECKING

from protocol.effects import table_of
from protocol.scene import Cable, Scene

from .held_points import HeldPoint, grasps_of

if TYPE_CHECKING:
    from protocol.messages import Problem, ShapeRequest


def start_request(scene: Scene) -> ShapeRequest:
    """What to ask for the first shapes of a scene, as long as no body is near; frames without twist (see `held_points`)."""
    from protocol.messages import ShapeRequest

    problems = tuple(_problem(cable, scene) for cable in scene.cables)
    return ShapeRequest(session="start", step=0, round=0, gravity=scene.gravity, tolerance=scene.tolerance, problems=problems)


def _problem(cable: Cable, scene: Scene) -> Problem:
    from protocol.messages import Problem

    held = tuple(
        HeldPoint(at=gripper.at, position=gripper.position, tangent=gripper.tangent, hold=gripper.hold)
        for gripper in scene.grippers
        if gripper.cable == cable.name
    )
    return Problem(cable=cable, grasps=grasps_of(held), effects=table_of(scene.effects))
