"""The rigid side of a scene: which paths of the grippers are refused before the first step."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace

import pytest

from env_server.stage import Stage
from protocol.errors import SceneError
from protocol.kinds import Hold
from protocol.scene import Cable, Gripper, Move, Scene, Target

CABLE = Cable(name="c", length=1.0, diameter=0.01, mass_per_length=0.1, bending=1e-2, twist=1e-2)
GRIPPERS = (
    Gripper(name="left", cable="c", at=0.0, position=(0.0, 0.3, 1.0), tangent=(0.0, -1.0, 0.0)),
    Gripper(name="right", cable="c", at=1.0, position=(0.0, -0.3, 1.0), tangent=(0.0, -1.0, 0.0)),
)


def pulled_apart(cable: Cable, hold: Hold = Hold.CLAMP) -> Scene:
    """Two grippers that come to be 1.1 m apart, with one metre of cable between them."""
    move = Move(name="pull", duration=0.1, targets=(Target(gripper="right", by=(0.0, -0.5, 0.0)),))
    return Scene(title="t", cables=(cable,), grippers=(GRIPPERS[0], replace(GRIPPERS[1], hold=hold)), moves=(move,))


@pytest.mark.parametrize("hold", [Hold.CLAMP, Hold.HINGE])
def test_a_path_that_pulls_a_cable_beyond_its_length_is_refused(hold: Hold) -> None:
    words = "moves: in 'pull' the grippers 'left' and 'right' come to be 1.1 m apart, with 1 m of cable 'c' between them"
    with pytest.raises(SceneError, match=words):
        Stage(pulled_apart(CABLE, hold), lambda _: None)


@pytest.mark.parametrize(
    "scene", [pulled_apart(replace(CABLE, stretch=20.0)), pulled_apart(CABLE, Hold.GUIDE)], ids=["stretches", "slides"]
)
def test_a_cable_that_stretches_or_slides_may_be_pulled_beyond_its_length(scene: Scene) -> None:
    with closing(Stage(scene, lambda _: None)) as stage:
        last = stage.at_step(len(stage.path.times) - 1)
    assert last.positions[1] == pytest.approx([0.0, -0.8, 1.0])
