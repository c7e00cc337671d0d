"""A loop without sockets: the shape server's own function in place of its program, so that a test sees every step."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from typing import Any, cast

from env_server.asking import Asker
from env_server.loop import Loop
from env_server.stage import Stage
from env_server.stepped import Stepped
from protocol.messages import ShapeReply, ShapeRequest
from protocol.scene import Scene, check_scene
from shape_server import kernels
from shape_server.together import answers


class Direct:
    """Answers requests at once, in this process, and keeps them."""

    def __init__(self) -> None:
        self.requests: list[ShapeRequest] = []
        self.coding = 0.0

    def send(self, request: ShapeRequest) -> None:
        self.requests.append(request)

    def receive(self) -> ShapeReply:
        request = self.requests[-1]
        shapes, crossings = answers(request, cast(Any, kernels))
        return ShapeReply(session=request.session, step=request.step, round=request.round, shapes=shapes, busy=0.0, crossings=crossings)


def steps(scene: Scene, asker: Direct | None = None) -> Iterator[tuple[Stage, Stepped]]:
    """Every time step of a scene, the start first; ends after the first that fails."""
    check_scene(scene)
    with closing(Stage(scene, lambda _: None)) as stage:
        loop = Loop(stage, cast(Asker, asker or Direct()), "test")
        for step in range(stage.path.steps + 1):
            stepped = loop.advance(step) if step else loop.first()
            yield stage, stepped
            if any(cable.shape.outcome.value != "converged" for cable in stepped.cables):
                return
